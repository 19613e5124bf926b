//! Writes the files of an export: edits the scene, finds the rounding, verifies each file and moves it into place.

use super::asset_args::{AssetArgs, CropBox};
use super::exported::{Exported, Exports};
use super::sources::{open_photos, read_limits};
use super::views_progress::{ViewsProgress, views_to_render};
use litetex_exporters::ltgs::{LtgsOptions, encode};
use litetex_exporters::spz::{ShBits, SpzOptions};
use litetex_exporters::{
    AssetCamera, Format, METRES, Quality, SplatAsset, WriteOptions, num_sh_coefficients, read_asset,
    read_fallback, stage_asset,
};
use litetex_gs::capture::Capture;
use litetex_gs::console::{Interrupt, Log, device};
use litetex_gs::run::Trained;
use litetex_gs::stand_in::{self, MadeStandIn};
use litetex_gs::text::{counted, format_bytes, format_count};
use litetex_gs::verify::{
    Backends, BakedScene, Contribution, EXPORT_VIEWS, ExpectedImages, GoOn, PhotoPsnr, QualityLimits,
    ReadBack, Rounding, SceneRenderer, Verdict, evenly_spread, find_rounding, find_sh_bits, verify,
    views_around,
};
use litetex_gs::{Error, Report, Result, usage};
use std::path::{Path, PathBuf};

/// What all files of an export share.
struct Job<'a> {
    args: &'a AssetArgs,
    device: &'a str,
    go_on: GoOn<'a>,
    log: &'a Log,
}

/// What files are compared with.
struct Verification<'a> {
    renderer: SceneRenderer<'a>,
    expected: ExpectedImages<'a>,
    /// The test views and their photos, for figures that are not checked.
    tests: Option<(ExpectedImages<'a>, &'a Capture)>,
}

/// Edits the scene, then writes and verifies each file and puts it in its place if it is right. With the training that it
/// comes from, files are also compared with the photos of the test views.
///
/// # Errors
/// If nothing can be written or rendered. What is wrong with a single file is left to [`Exports::output`].
pub fn write_all(
    (mut scene, trained): (BakedScene, Option<&Trained>),
    outputs: &[PathBuf],
    args: &AssetArgs,
    device: &str,
    log: &Log,
) -> Result<Exports> {
    let interrupt = listen(log)?;
    let progress = ViewsProgress::new(log, views_to_render(&scene.asset, outputs, args));
    let go_on = || {
        progress.view();
        !interrupt.is_requested()
    };
    edit(&mut scene, args, &go_on, log)?;
    scene.asset.validate().map_err(|e| Error::from(e.at(&scene.path)))?;
    let photos = if args.no_verify { None } else { photos_of_tests(&scene, trained, log) };
    let (tests, mut training): (Vec<_>, Vec<_>) =
        scene.asset.cameras.iter().cloned().partition(|c| c.held_out);
    if training.is_empty() {
        training = views_around(&scene.asset);
        log.detail("no training cameras: files are compared with the scene from around it");
    }
    let views = [training, tests].map(|cameras| evenly_spread(&cameras, EXPORT_VIEWS));
    let job = Job { args, device, go_on: &go_on, log };
    let mut verification = job.verification(&scene.asset, [&views[0], &views[1]], photos.as_ref())?;
    let mut exports = Exports { files: Vec::new(), stopped: None };
    for path in outputs {
        let next = interrupt.check().and_then(|()| {
            let how = (job.rounding(&scene, path)?, job.spz_options(&scene.asset, path)?);
            job.write_one(&scene.asset, path, how, verification.as_mut())
        });
        match next {
            Ok(exported) => exports.files.push(exported),
            Err(error) => {
                exports.stopped = Some(error);
                break;
            }
        }
    }
    Ok(exports)
}

/// Changes a scene as the arguments say and reports how many splats were left out.
fn edit(scene: &mut BakedScene, args: &AssetArgs, go_on: GoOn<'_>, log: &Log) -> Result<()> {
    let asset = &mut scene.asset;
    let before = asset.num_splats();
    let log_left_out = |gone: usize, why: &str| {
        let [gone, before] = [gone, before].map(|n| format_count(n as u64));
        log.info(&format!("{gone} of {before} splats {why} and are left out"));
    };
    if let Some(floor) = args.min_contribution {
        let training: Vec<_> = asset.cameras.iter().filter(|c| !c.held_out).cloned().collect();
        let mut backend = device::open("cpu", log)?;
        let contribution = Contribution::measure(backend.as_mut(), asset, &training, go_on)?;
        let keep: Vec<bool> = contribution.weight_px.iter().map(|c| *c >= floor).collect();
        log_left_out(asset.retain(&keep), &format!("contribute less than {floor} pixels"));
    }
    if let Some(CropBox { low, high }) = args.crop {
        log_left_out(asset.crop(low, high), "are outside the box");
    }
    if asset.num_splats() == 0 {
        let why = match before {
            0 => "the scene has no splats",
            _ => "--crop and --min-contribution leave no splats",
        };
        return Err(usage!("{}: {why}", scene.path.display()));
    }
    if asset.num_splats() < before {
        scene.quantisation = None;
    }
    if let Some(factor) = args.scale {
        asset.set_scale(factor);
        asset.provenance.scale =
            format!("{METRES}: a unit of the capture is {factor} m, as requested with --scale");
    }
    if !asset.provenance.scale.is_empty() {
        log.info(&format!("scale: {}", asset.provenance.scale));
    }
    if let Some(origin) = args.origin {
        log.info(&origin.apply(asset));
    }
    let facts = &mut asset.provenance;
    for (field, given) in [
        (&mut facts.title, &args.title),
        (&mut facts.author, &args.author),
        (&mut facts.licence, &args.licence),
        (&mut facts.source, &args.made_from),
    ] {
        if let Some(text) = given {
            field.clone_from(text);
        }
    }
    Ok(())
}

/// The photos of the scene's test views; `None` if there are none, or they are no longer there.
fn photos_of_tests(scene: &BakedScene, trained: Option<&Trained>, log: &Log) -> Option<Capture> {
    if !scene.asset.cameras.iter().any(|c| c.held_out) {
        return None;
    }
    let photos = open_photos(scene, trained, None, log);
    photos.unwrap_or_else(|error| {
        log.warn("no-test-photos", &format!("files are not compared with the test photos: {error}"), 1);
        None
    })
}

impl<'a> Job<'a> {
    /// Renders the scene at training and test views, unless files are not to be verified.
    fn verification(
        &self,
        asset: &'a SplatAsset,
        [views, tests]: [&'a [AssetCamera]; 2],
        photos: Option<&'a Capture>,
    ) -> Result<Option<Verification<'a>>> {
        let &Self { args, device, go_on, log } = self;
        if args.no_verify {
            log.detail("the files are not verified");
            return Ok(None);
        }
        let mut renderer = SceneRenderer::new(device::open(device, log)?, go_on);
        let expected = ExpectedImages::render(&mut renderer, asset, views)?;
        let of_tests =
            |photos| Ok::<_, Error>((ExpectedImages::render(&mut renderer, asset, tests)?, photos));
        let tests = photos.map(of_tests).transpose()?;
        Ok(Some(Verification { renderer, expected, tests }))
    }

    /// How the numbers of a file are rounded. Bounds of size and loss are only for `.ltgs` files.
    fn rounding(&self, scene: &BakedScene, path: &Path) -> Result<Rounding> {
        let &Self { args, device, go_on, log } = self;
        // Lossless files have nothing to look for; bounds contradict them, which the search reports.
        let goal = args
            .goal_of(Format::of(path)?)
            .filter(|goal| goal.quality != Quality::Lossless || goal.own_limits().is_some());
        let Some(goal) = goal else {
            if args.effort.is_some() {
                let what =
                    "--effort applies only to lossy .ltgs and .html files and to glTF files of quality tiny";
                log.warn("effort-not-applied", &format!("{}: {what}", path.display()), 1);
            }
            return Ok(Rounding::plain(args.quality()));
        };
        let of_source = scene.contents.as_ref().and_then(|contents| contents.quality);
        if let Some(lossy) = of_source.filter(|&quality| quality != Quality::Lossless) {
            let (source, lossy) = (scene.path.display(), lossy.name());
            let what = format!("made of {source}, which is of quality {lossy}: the losses of both add up");
            log.warn("lossy-source", &format!("{}: {what}", path.display()), 1);
        }
        if goal != args.rate_goal() {
            let what =
                "--max-size and --max-loss bound only .ltgs files; the file keeps the limits of its quality";
            log.warn("bounds-not-applied", &format!("{}: {what}", path.display()), 1);
        }
        let mut report = Report::default();
        let backends = Backends {
            statistics: &|| device::open("cpu", log),
            rendering: &|| device::open(device, log),
            go_on,
        };
        let rounding = find_rounding(scene, &goal, &backends, &mut report).map_err(|error| match error {
            Error::Usage(what) if args.preview && args.max_size.is_some() => {
                usage!("{what}; --preview takes a twelfth of the size: leave it out, or give more")
            }
            error => error,
        })?;
        log.report(&report);
        Ok(rounding)
    }

    /// How to write a `.spz` file: the bits of its SH coefficients are those that the quality needs.
    fn spz_options(&self, asset: &SplatAsset, path: &Path) -> Result<SpzOptions> {
        let &Self { args, device, go_on, log } = self;
        let options = args.spz();
        if Format::of(path)? != Format::Spz {
            return Ok(options);
        }
        let open = || Ok(SceneRenderer::new(device::open(device, log)?, go_on));
        let sh_bits = find_sh_bits(asset, args.quality(), open)?;
        if asset.sh_degree > 0 {
            let ShBits { first, rest } = sh_bits;
            log.detail(&format!(
                "{}: SH in {first} bits (degree 1) and {rest} bits (others)",
                path.display()
            ));
        }
        Ok(SpzOptions { sh_bits, ..options })
    }

    fn write_one(
        &self,
        asset: &SplatAsset,
        path: &Path,
        (rounding, spz): (Rounding, SpzOptions),
        verification: Option<&mut Verification<'_>>,
    ) -> Result<Exported> {
        let &Self { args, log, .. } = self;
        if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        }
        if args.quality.is_some() && Format::of(path)? == Format::Ply {
            let what = "this format has a single quality: --quality does not apply";
            log.warn("quality-not-applied", &format!("{}: {what}", path.display()), 1);
        }
        let Rounding { quality, steps, .. } = rounding;
        let options = WriteOptions {
            quality,
            mesh: args.mesh,
            steps,
            per_splat: rounding.per_splat(),
            stand_in: None,
            cameras: args.cameras(),
            ply_up: args.up.unwrap_or_default().ply,
            spz,
        };
        let rounded = rounding.adapted.as_ref().unwrap_or(asset);
        let made = self.stand_in(rounded, path, &options)?;
        let options = WriteOptions { stand_in: made.as_ref().map(MadeStandIn::as_written), ..options };
        let staged = stage_asset(path, rounded, &options)?;
        for note in &staged.written().notes {
            log.warn("export", &format!("{}: {note}", path.display()), 1);
        }
        let limits = args.rate_goal().own_limits().filter(|_| Format::from_path(path) == Some(Format::Ltgs));
        let verified = verification.map(|with| verify_staged(with, &staged.path(), limits)).transpose()?;
        let (verdict, on_test_photos) = verified.unzip();
        // A file that failed replaces nothing.
        let is_right = verdict.as_ref().is_none_or(|v| v.failures.is_empty());
        let written = if is_right { staged.publish(args.force)? } else { staged.written().clone() };
        let on_test_photos = on_test_photos.flatten();
        let loses_textures = asset.num_texels() > 0 && !Format::of(path)?.keeps_textures();
        let (path, raw_bytes) = (path.to_owned(), raw_bytes(asset));
        Ok(Exported { path, written, raw_bytes, stand_in: made, verdict, on_test_photos, loses_textures })
    }

    /// The stand-in of a file, if one is wanted and the file can have it.
    fn stand_in(
        &self,
        asset: &SplatAsset,
        path: &Path,
        options: &WriteOptions<'_>,
    ) -> Result<Option<MadeStandIn>> {
        let &Self { args, device, go_on, log } = self;
        if !args.preview {
            return Ok(None);
        }
        let none = |why: &str| {
            log.warn("no-stand-in", &format!("{}: no stand-in: {why}", path.display()), 1);
            Ok(None)
        };
        let format = Format::of(path)?;
        let &WriteOptions { quality, steps, per_splat, .. } = options;
        if !args.puts_stand_in(format, quality) {
            return none("only .ltgs files and glTF files of quality tiny begin with one");
        }
        let file = encode(asset, &LtgsOptions { quality, steps, per_splat, ..LtgsOptions::default() })
            .map_err(|e| e.at(path))?;
        let backends = Backends {
            statistics: &|| device::open("cpu", log),
            rendering: &|| device::open(device, log),
            go_on,
        };
        let max_bytes = args.max_size.filter(|_| format == Format::Ltgs);
        match stand_in::make(&file, max_bytes, &backends)? {
            Ok(made) => {
                log.info(&format!("{}: {}", path.display(), words_of(&made)));
                Ok(Some(made))
            }
            Err(why) => none(why),
        }
    }
}

fn words_of(made: &MadeStandIn) -> String {
    let MadeStandIn { file, splats, psnr, until_bytes, scene_bytes } = made;
    let share = 100.0 * *until_bytes as f64 / (*scene_bytes).max(1) as f64;
    format!(
        "stand-in of {}, {}, {psnr:.1} dB against the scene; shown until {share:.0} % of the scene has arrived",
        format_bytes(file.len() as u64),
        counted(*splats, "splat")
    )
}

/// Reads a file back and compares its images with the scene's, and with the photos of test views if they are there.
fn verify_staged(
    with: &mut Verification<'_>,
    path: &Path,
    limits: Option<QualityLimits>,
) -> Result<(Verdict, Option<PhotoPsnr>)> {
    let contents = read_asset(path, &read_limits())?;
    let limits = limits.unwrap_or_else(|| QualityLimits::of_file(path, &contents));
    let fallback = read_fallback(path, &read_limits())?;
    let textured = Format::of(path)?.keeps_textures();
    let file = ReadBack { asset: &contents.asset, textured, fallback: fallback.as_ref() };
    let verdict = verify(&mut with.renderer, &with.expected, file, None, limits)?;
    let Some((expected, photos)) = &with.tests else { return Ok((verdict, None)) };
    let on_tests = verify(&mut with.renderer, expected, file, Some(*photos), QualityLimits::NONE)?;
    Ok((verdict, on_tests.on_test_photos))
}

/// Bytes of the numbers of a scene as f32 and u16.
fn raw_bytes(asset: &SplatAsset) -> u64 {
    let per_splat = 4 * (3 + 4 + 2 + 1 + 1) + 4;
    let sh: usize = asset.sh_degrees.iter().map(|&degree| 3 * num_sh_coefficients(degree.into())).sum();
    (asset.num_splats() * per_splat + 4 * (sh + asset.texels.len())) as u64
}

/// Takes over Ctrl-C, before the first file is created: neither probes nor staged files may stay behind.
pub fn listen(log: &Log) -> Result<Interrupt> {
    Interrupt::listen(log, "removing unfinished files")
}
