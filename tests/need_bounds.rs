//! The bounds of `samples/need.toml`: models built by hand, which reach the PSNR that the suite asks for in the production
//! renderer, at the size of its photos. A bound without such a model would be none.

#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::need::{Surfel, Views, model};
use common::training::uploaded;
use litetex_exporters::ltgs::{LtgsOptions, encode};
use litetex_exporters::{Provenance, Quality};
use litetex_gs::Report;
use litetex_gs::constants::SH_0;
use litetex_gs::model::{AdamState, Model, TextureMap, TexturePool};
use litetex_gs::sample::planted_model;
use litetex_gs::verify::bake_checkpoint;
use serde::Deserialize;
use std::path::Path;

/// Where a summary has the bytes of the file.
const BYTES: &str = "/size/disk/ltgs_tiny";

const SIZE_PX: [u32; 2] = [128, 96];

/// PSNR that a model must reach, dB; of the planted splats.
const PSNR: f64 = 40.0;
const PSNR_PLANTED: f64 = 35.0;

/// Numbers of colours along the walls, texels along the maps of their bounds, and side of a texel over that with which
/// the turned map would just contain the wall: the corners are nearly grey.
const WALLS: [(u32, u16, f64); 3] = [(4, 9, 0.9), (8, 17, 0.9), (16, 34, 0.94)];

/// A splat whose map is turned by 20 degrees against the wall.
fn wall(side: u16, scale: f64) -> Model {
    let angle = 20_f64.to_radians();
    let texel = scale * (angle.cos() + angle.sin()) / f64::from(side + 1);
    model(&[Surfel { angle, sigma: 0.5, map: [side; 2], texel: [texel; 2], ..Surfel::default() }])
}

/// Splats on three quadrants; the fourth has the colour of the background.
fn quilt(fine: u16) -> Model {
    let quadrant = |x: f64, y: f64, n: u16| Surfel {
        centre: [0.25 * x, 0.25 * y, 0.0],
        sigma: 0.2,
        map: [n; 2],
        texel: [0.5 / f64::from(n + 1); 2],
        ..Surfel::default()
    };
    model(&[quadrant(1.0, -1.0, 2), quadrant(-1.0, 1.0, 16), quadrant(1.0, 1.0, fine)])
}

/// A map of `across` by `along` texels, turned by some degrees.
fn stripes(degrees: f64, across: u16, along: u16) -> Model {
    let texel = [across, along].map(|texels| 1.0 / f64::from(texels + 1));
    model(&[Surfel {
        angle: degrees.to_radians(),
        sigma: 0.7,
        map: [across, along],
        texel,
        ..Surfel::default()
    }])
}

/// A wall, and before it a splat of the given degree.
fn gloss(degree: u32) -> Model {
    let wall = Surfel { map: [8; 2], texel: [1.0 / 9.0; 2], ..Surfel::default() };
    model(&[
        wall,
        Surfel { centre: [0.0, 0.0, -0.001], sigma: 0.1515, opacity: 0.5, degree, ..Surfel::default() },
    ])
}

/// The bound of a scene, before its texels are fitted.
fn bound(scene: &str) -> Model {
    match scene {
        "flat" | "flat:0.5" => model(&[Surfel::default()]),
        "quilt" => quilt(32),
        "stripes:0" => stripes(0.0, 15, 15),
        "stripes:30" => stripes(30.0, 15, 15),
        "planted" => planted_model(0),
        "gloss" => gloss(1),
        _ => {
            let of = |(n, side, scale)| (scene == format!("wall:{n}")).then(|| wall(side, scale));
            WALLS.into_iter().find_map(of).unwrap()
        }
    }
}

/// What the suite says of its scenes.
#[derive(Deserialize)]
struct Suite {
    scene: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    name: String,
    sample: Vec<String>,
    #[serde(default)]
    check: Vec<Check>,
}

#[derive(Deserialize)]
struct Check {
    measure: String,
    over: Option<f64>,
}

fn cases() -> Vec<Case> {
    let suite = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/need.toml");
    toml::from_str::<Suite>(&std::fs::read_to_string(suite).unwrap()).unwrap().scene
}

#[test]
fn the_suite_uses_the_sizes_of_the_bounds() {
    let mut compared = 0;
    for scene in cases() {
        let size = bound(scene_of(&scene)).size();
        for check in scene.check.iter().filter(|check| check.over.is_some()) {
            let expected = match check.measure.as_str() {
                "/size/params" => size.params(),
                "/size/texels" => size.texels,
                "/size/splats" => size.splats,
                "/size/sh_coefficients" => size.sh_coefficients,
                // Compared where models are fitted.
                BYTES => continue,
                other => panic!("{other}"),
            };
            assert_eq!(check.over, Some(expected as f64), "{}: {}", scene.name, check.measure);
            compared += 1;
        }
    }
    assert_eq!(compared, 44);
}

/// The scene of a case.
fn scene_of(case: &Case) -> &str {
    let at = case.sample.iter().position(|arg| arg == "--scene").unwrap();
    &case.sample[at + 1]
}

/// Compares the size of a fitted bound, as a file with standard steps, with what the suite says. Fits may differ in the last
/// digits between machines, and by as little the bytes of their codes: 2 %. Not measured.
fn assert_bytes(scene: &str, model: &Model) {
    let mut backend = uploaded(model);
    let state = (model, &AdamState::zeros(model));
    let provenance = Provenance::default();
    let asset =
        bake_checkpoint(&mut backend, state, Vec::new(), [0.0; 3], provenance, &mut Report::default())
            .unwrap();
    let options = LtgsOptions { quality: Quality::Tiny, ..LtgsOptions::default() };
    let found = encode(&asset, &options).unwrap().len() as f64;
    println!("{scene}: {found} bytes");
    let mut compared = 0;
    for case in cases().iter().filter(|case| scene_of(case) == scene) {
        for check in case.check.iter().filter(|check| check.measure == BYTES) {
            let stated = check.over.unwrap();
            assert!((found / stated - 1.0).abs() < 0.02, "{}: {found} bytes, {stated} stated", case.name);
            compared += 1;
        }
    }
    assert!(compared > 0, "{scene}");
}

/// Fits both models, and compares them with the PSNR asked for: `control` must not reach it.
fn reaches(scene: &str, control: &Model, has_sh: bool) {
    let views = Views::new(scene, SIZE_PX);
    let (fitted, psnr) = views.fit(&bound(scene), has_sh);
    assert_bytes(scene, &fitted);
    let (_, below) = views.fit(control, has_sh);
    println!("{scene}: {psnr:.2} dB, control {below:.2} dB, {:?}", bound(scene).size());
    assert!(psnr >= PSNR && below < PSNR, "{scene}: {psnr} dB, control {below} dB");
}

#[test]
fn a_turned_map_shows_the_wall() {
    for (n, side, scale) in WALLS {
        reaches(&format!("wall:{n}"), &wall(side - 2, scale), false);
    }
}

/// An even grid of splats, all with turned maps of this side. The maps together are as wide as `wall`'s.
fn grid_of_splats(per_side: u16, side: u16, sigma: f64, scale: f64) -> Model {
    let angle = 20_f64.to_radians();
    let cell = 1.0 / f64::from(per_side);
    let texel = scale * cell * (angle.cos() + angle.sin()) / f64::from(side + 1);
    let centre = |at: u16| (f64::from(at) + 0.5) * cell - 0.5;
    let surfel = |(i, j): (u16, u16)| Surfel {
        centre: [centre(i), centre(j), 0.0],
        angle,
        sigma: sigma * cell,
        map: [side; 2],
        texel: [texel; 2],
        ..Surfel::default()
    };
    let cells = (0..per_side).flat_map(|i| (0..per_side).map(move |j| (i, j)));
    model(&cells.map(surfel).collect::<Vec<_>>())
}

#[test]
fn more_splats_do_not_show_the_wall_with_fewer_parameters() {
    let (views, bound) = (Views::new("wall:8", SIZE_PX), bound("wall:8").num_params());
    // 4, 9 and 16 splats with the largest maps that leave them below the bound.
    for (per_side, side) in [(2, 8), (3, 5), (4, 3)] {
        for (sigma, scale) in [(0.4, 0.9), (0.5, 1.0), (0.7, 0.9), (0.7, 1.1)] {
            let model = grid_of_splats(per_side, side, sigma, scale);
            let larger = grid_of_splats(per_side, side + 1, sigma, scale);
            assert!(model.num_params() < bound && larger.num_params() > bound);
            let (_, psnr) = views.fit(&model, false);
            println!(
                "{per_side} x {per_side} splats of {side} x {side} texels, {sigma}, {scale}: {psnr:.2} dB"
            );
            assert!(psnr < PSNR, "{per_side} x {per_side}: {psnr} dB");
        }
    }
    // Negative control: such a grid with enough texels.
    let (_, psnr) = views.fit(&grid_of_splats(2, 16, 0.4, 1.1), false);
    assert!(psnr >= PSNR, "{psnr} dB");
}

#[test]
fn a_map_along_the_wall_needs_one_texel_per_colour() {
    let aligned = Surfel { map: [8; 2], texel: [1.0 / 9.0; 2], ..Surfel::default() };
    let (_, psnr) = Views::new("wall:8", SIZE_PX).fit(&model(&[aligned]), false);
    assert!(psnr > PSNR, "{psnr}");
}

#[test]
fn three_maps_show_the_quilt() {
    reaches("quilt", &quilt(24), false);
}

#[test]
fn one_map_shows_stripes_however_they_are_turned() {
    reaches("stripes:0", &stripes(0.0, 13, 13), false);
    reaches("stripes:30", &stripes(0.0, 15, 15), false);
}

#[test]
fn a_fifth_of_the_texels_is_enough_if_they_are_as_long_as_the_stripes() {
    for (scene, degrees) in [("stripes:0", 0.0), ("stripes:30", 30.0)] {
        let views = Views::new(scene, SIZE_PX);
        let of = |model: &Model| views.fit(model, false).1;
        let (psnr, turned) = (of(&stripes(degrees, 15, 3)), of(&stripes(degrees, 3, 15)));
        assert!(psnr >= PSNR && turned < PSNR, "{scene}: {psnr} dB, turned {turned} dB");
    }
}

#[test]
fn a_splat_of_degree_1_shows_the_gloss() {
    reaches("gloss", &gloss(0), true);
}

#[test]
fn one_splat_is_enough_where_nothing_is_to_be_seen() {
    for scene in ["flat", "flat:0.5"] {
        let views = Views::new(scene, SIZE_PX);
        let mut model = bound(scene);
        assert!(views.psnr(&model) > 50.0, "{scene}: {}", views.psnr(&model));
        assert_bytes(scene, &model);
        // Negative control: the wrong colour, by 4 of 255.
        model.splats.sh.iter_mut().for_each(|c| *c += (4.0 / 255.0 / SH_0) as f32);
        assert!(views.psnr(&model) < PSNR, "{scene}: {}", views.psnr(&model));
    }
}

#[test]
fn the_planted_model_shows_its_photos() {
    let views = Views::new("planted", SIZE_PX);
    let known = planted_model(0);
    let psnr = views.psnr(&known);
    assert_bytes("planted", &known);
    let coarse = known.textures.maps.iter().map(|map| TextureMap::square(4, 4, 2.0 * map.texel_sizes[0]));
    let control = Model { textures: TexturePool::neutral(coarse).unwrap(), ..known.clone() };
    let (_, below) = views.fit(&control, false);
    println!("planted: {psnr:.2} dB, control {below:.2} dB");
    assert!(psnr >= PSNR_PLANTED && below < PSNR_PLANTED, "{psnr} dB, control {below} dB");
}
