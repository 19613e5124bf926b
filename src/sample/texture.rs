//! Procedural patterns of the sample scene: albedo in linear light as a function of the position on a
//! surface, in metres.
//!
//! Details measure a few millimetres to a few centimetres, about one to ten pixels of the default images.

use super::lettering::{small_print, text};
use super::noise::Noise;
use glam::{DVec2, DVec3};

/// Centre and half size of the poster on the back wall, in the coordinates of its texture.
pub const POSTER: (DVec2, DVec2) = (DVec2::new(0.0, -0.28), DVec2::new(0.78, 0.46));

/// Distance of `x` from the nearest multiple of `period`.
fn from_line(x: f64, period: f64) -> f64 {
    (x / period - (x / period).round()).abs() * period
}

fn mix(a: DVec3, b: DVec3, t: f64) -> DVec3 {
    a.lerp(b, t.clamp(0.0, 1.0))
}

fn checker(at: DVec2, size: f64) -> bool {
    ((at.x / size).floor() + (at.y / size).floor()).rem_euclid(2.0) < 0.5
}

/// Wood with its grain along `at.y`; `tone`, 0 to 1, varies its brightness.
fn wood(noise: &Noise, at: DVec2, tone: f64) -> DVec3 {
    let warp = noise.fractal(DVec2::new(at.x * 9.0, at.y * 1.3));
    let rings = 0.5 + 0.5 * (at.x * 130.0 + 22.0 * warp).sin();
    let pores = noise.value(DVec2::new(at.x * 210.0, at.y * 14.0));
    let light = DVec3::new(0.56, 0.32, 0.15) * (0.72 + 0.5 * tone);
    let dark = DVec3::new(0.25, 0.115, 0.045) * (0.8 + 0.4 * tone);
    mix(light, dark, 0.62 * rings * warp + 0.45 * (pores - 0.45).max(0.0) * 2.0)
}

/// Floor: planks, with a chequered, bordered rug in the middle.
pub fn floor(noise: &Noise, at: DVec2) -> DVec3 {
    let half = DVec2::new(1.25, 0.85);
    let inside = (half - at.abs()).min_element();
    if inside > 0.0 {
        let weave = 0.86 + 0.14 * (at.x * 260.0).sin() * (at.y * 260.0).sin();
        let wear = 0.8 + 0.35 * noise.fractal(at * 6.0);
        let colour = if inside < 0.03 {
            DVec3::new(0.55, 0.42, 0.2)
        } else if inside < 0.09 {
            let zigzag = from_line(at.x + at.y, 0.06) > 0.015;
            if zigzag { DVec3::new(0.3, 0.03, 0.04) } else { DVec3::new(0.7, 0.6, 0.4) }
        } else if checker(at, 0.1) {
            let dot = (at - (at / 0.1).floor() * 0.1 - 0.05).length() < 0.018;
            if dot { DVec3::new(0.6, 0.2, 0.06) } else { DVec3::new(0.68, 0.62, 0.5) }
        } else {
            DVec3::new(0.05, 0.1, 0.22)
        };
        return colour * weave * wear;
    }
    let plank = (at.x / 0.15).floor();
    let shift = noise.cell(plank as i64, 7);
    let along = at.y / 1.15 + shift;
    let tone = noise.cell(plank as i64, along.floor() as i64);
    let gap = from_line(at.x, 0.15).min(1.15 * from_line(along, 1.0));
    let offset = DVec2::new(plank * 3.7, along.floor() * 5.1);
    wood(noise, at + offset, tone) * if gap < 0.0035 { 0.3 } else { 1.0 }
}

/// Back wall: bricks with a framed poster.
pub fn back_wall(noise: &Noise, at: DVec2) -> DVec3 {
    let poster = at - POSTER.0;
    let inside = (POSTER.1 - poster.abs()).min_element();
    if inside > 0.0 {
        return if inside < 0.035 { DVec3::splat(0.03) } else { poster_face(noise, poster) };
    }
    let course = (at.y / 0.085).floor();
    let x = at.x + if course.rem_euclid(2.0) < 0.5 { 0.0 } else { 0.12 };
    let mortar = from_line(at.y, 0.085).min(from_line(x, 0.24)) < 0.0055;
    let grain = noise.fractal(at * 38.0);
    if mortar {
        return DVec3::new(0.52, 0.49, 0.44) * (0.75 + 0.4 * grain);
    }
    let tone = noise.cell((x / 0.24).floor() as i64, course as i64);
    let brick = mix(DVec3::new(0.42, 0.12, 0.065), DVec3::new(0.55, 0.24, 0.13), tone);
    brick * (0.55 + 0.75 * grain)
}

fn poster_face(noise: &Noise, at: DVec2) -> DVec3 {
    let paper = DVec3::new(0.8, 0.77, 0.68) * (0.94 + 0.08 * noise.value(at * 45.0));
    if text("LITETEX", at - DVec2::new(0.0, 0.22), 0.028) {
        return DVec3::new(0.5, 0.04, 0.05);
    }
    if text("2D GAUSSIAN SPLATS", at - DVec2::new(0.0, 0.03), 0.0115) {
        return DVec3::splat(0.04);
    }
    let block = at - DVec2::new(-0.33, -0.2);
    if (DVec2::new(0.3, 0.15) - block.abs()).min_element() > 0.0 && small_print(noise, block, 0.006) {
        return DVec3::splat(0.05);
    }
    // A colour wheel with rings, cut by lines.
    let wheel = at - DVec2::new(0.37, -0.2);
    let radius = wheel.length();
    if radius < 0.17 {
        let sector = (wheel.to_angle() / std::f64::consts::TAU * 12.0).floor() as i64;
        let ring = (radius / 0.034).floor() as i64;
        let hue = |k: i64| 0.12 + 0.65 * noise.cell(sector * 3 + k, ring + 90);
        return DVec3::new(hue(0), hue(1), hue(2));
    }
    paper
}

/// A checkerboard in black and white.
pub fn checkerboard(at: DVec2, period: f64) -> DVec3 {
    DVec3::splat(if checker(at, 0.5 * period) { 0.75 } else { 0.05 })
}

/// Left wall: a woven plaid.
pub fn plaid(noise: &Noise, at: DVec2) -> DVec3 {
    let bands = |x: f64| {
        let p = x.rem_euclid(0.36);
        if p < 0.15 {
            DVec3::new(0.09, 0.24, 0.16)
        } else if !(0.17..=0.34).contains(&p) {
            DVec3::new(0.75, 0.65, 0.3)
        } else {
            DVec3::new(0.5, 0.5, 0.42)
        }
    };
    let over = checker(at, 0.012);
    let thread = if over { bands(at.x) } else { bands(at.y) };
    0.5 * (thread + 0.5 * (bands(at.x) + bands(at.y))) * (0.85 + 0.3 * noise.value(at * 22.0))
}

/// Right wall: wallpaper with rings and dots.
pub fn wallpaper(noise: &Noise, at: DVec2) -> DVec3 {
    let row = (at.y / 0.2).floor();
    let x = at.x + if row.rem_euclid(2.0) < 0.5 { 0.0 } else { 0.1 };
    let radius = DVec2::new(from_line(x - 0.1, 0.2), from_line(at.y - 0.1, 0.2)).length();
    let ground = DVec3::new(0.2, 0.33, 0.45) * (0.9 + 0.2 * noise.fractal(at * 15.0));
    if radius < 0.022 {
        DVec3::new(0.75, 0.4, 0.2)
    } else if (0.045..0.056).contains(&radius) {
        DVec3::new(0.72, 0.74, 0.7)
    } else {
        ground
    }
}

/// Ceiling, and the wall behind the cameras: plaster panels.
pub fn plaster(noise: &Noise, at: DVec2) -> DVec3 {
    let seam = from_line(at.x, 0.6).min(from_line(at.y, 0.6)) < 0.006;
    DVec3::new(0.72, 0.7, 0.66) * (0.86 + 0.2 * noise.fractal(at * 9.0)) * if seam { 0.6 } else { 1.0 }
}

/// A face of the wooden crate: frame, slats, nails and lettering. `half` is the face's half size.
pub fn crate_face(noise: &Noise, at: DVec2, half: DVec2) -> DVec3 {
    let edge = (half - at.abs()).min_element();
    if edge < 0.05 {
        let upright = half.x - at.x.abs() < 0.05;
        let nail = (at.abs() - (half - 0.025)).length() < 0.008;
        let grain = if upright { at } else { DVec2::new(at.y, at.x) };
        return if nail { DVec3::splat(0.06) } else { wood(noise, grain + 31.0, 0.9) };
    }
    let slat = (at.y / 0.07).floor();
    let gap = from_line(at.y, 0.07) < 0.004 || edge < 0.055;
    if (at.x.abs() < 0.14) && text("TEX2", at, 0.0105) {
        return DVec3::new(0.06, 0.05, 0.05);
    }
    let tone = noise.cell(slat as i64, 55);
    wood(noise, DVec2::new(at.y + 3.0 * slat, at.x), tone * 0.7) * if gap { 0.25 } else { 1.0 }
}

/// A face of the printed carton. `half` is the face's half size.
pub fn carton_face(noise: &Noise, at: DVec2, half: DVec2) -> DVec3 {
    let relative = at / half;
    let white = DVec3::new(0.8, 0.8, 0.76);
    if half.min_element() < 0.1 {
        // Narrow sides carry small print.
        let margin = (half - at.abs()).min_element() > 0.015;
        return if margin && small_print(noise, at, 0.0045) { DVec3::splat(0.04) } else { white };
    }
    if text("SPLATS", at - DVec2::new(0.0, 0.6 * half.y), 0.0072) {
        return white;
    }
    let disc = (at + DVec2::new(0.0, 0.05 * half.y)).length() / half.x;
    if disc < 0.62 {
        let ray = (at.y + 0.05 * half.y).atan2(at.x) / std::f64::consts::TAU * 20.0;
        let stripe = ray.rem_euclid(2.0) < 1.0;
        return if disc < 0.22 {
            DVec3::new(0.6, 0.05, 0.04)
        } else if stripe {
            DVec3::new(0.85, 0.62, 0.08)
        } else {
            white
        };
    }
    if relative.y < -0.72 {
        let print = relative.abs().max_element() < 0.93 && small_print(noise, at, 0.0042);
        return if print { DVec3::splat(0.05) } else { DVec3::new(0.85, 0.75, 0.3) };
    }
    mix(DVec3::new(0.07, 0.22, 0.5), DVec3::new(0.1, 0.42, 0.45), 0.5 + 0.5 * relative.y)
}

/// A face of the book pile: covers at top and bottom, page edges at the sides.
pub fn book_face(noise: &Noise, at: DVec2, half: DVec2, is_cover: bool) -> DVec3 {
    if is_cover {
        let edge = (half - at.abs()).min_element();
        let gold = DVec3::new(0.7, 0.5, 0.15);
        let lettering = text("TEXTURES", at - DVec2::new(0.0, 0.04), 0.0062)
            || (at.y < 0.01 && at.y > -0.09 && at.x.abs() < 0.12 && small_print(noise, at, 0.0045));
        return if lettering || (0.014..0.02).contains(&edge) {
            gold
        } else {
            DVec3::new(0.28, 0.03, 0.06) * (0.8 + 0.4 * noise.fractal(at * 60.0))
        };
    }
    let cover = half.y - at.y.abs() < 0.008 || at.y.abs() < 0.006;
    if cover {
        return DVec3::new(0.1, 0.14, 0.05);
    }
    let sheet = noise.value(DVec2::new(at.x * 4.0, at.y * 330.0));
    DVec3::new(0.76, 0.7, 0.55) * (0.6 + 0.45 * sheet)
}

/// The globe: sea, land, ice and a graticule. `direction` is a unit vector from the centre, y down.
pub fn globe(noise: &Noise, direction: DVec3) -> DVec3 {
    let longitude = direction.x.atan2(-direction.z);
    let latitude = (-direction.y).clamp(-1.0, 1.0).asin();
    // Triplanar noise has neither a seam nor poles.
    let w = direction * direction;
    let height = w.x * noise.fractal(DVec2::new(direction.y, direction.z) * 2.6 + 9.0)
        + w.y * noise.fractal(DVec2::new(direction.x, direction.z) * 2.6 + 40.0)
        + w.z * noise.fractal(DVec2::new(direction.x, direction.y) * 2.6 + 71.0);
    let step = std::f64::consts::PI / 12.0;
    let meridian = from_line(longitude, step) * latitude.cos();
    if meridian.min(from_line(latitude, step)) < 0.017 {
        return DVec3::new(0.72, 0.7, 0.6);
    }
    if latitude.abs() > 1.22 {
        DVec3::splat(0.8)
    } else if height > 0.52 {
        mix(DVec3::new(0.12, 0.32, 0.08), DVec3::new(0.5, 0.33, 0.14), (height - 0.52) * 7.0)
    } else if height > 0.5 {
        DVec3::new(0.7, 0.62, 0.38)
    } else {
        DVec3::new(0.04, 0.15, 0.38) * (0.7 + 0.8 * height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_albedo_is_between_0_and_1() {
        let noise = Noise::new(0);
        for i in 0..20_000 {
            let at = DVec2::new(noise.cell(i, 0) * 6.0 - 3.0, noise.cell(i, 1) * 4.0 - 2.0);
            let half = DVec2::new(0.2, 0.25);
            let small = at * 0.06;
            let direction = DVec3::new(at.x, at.y, 0.3).normalize();
            for albedo in [
                floor(&noise, at),
                back_wall(&noise, at),
                plaid(&noise, at),
                wallpaper(&noise, at),
                plaster(&noise, at),
                crate_face(&noise, small, half),
                carton_face(&noise, small, half),
                carton_face(&noise, small, DVec2::new(0.07, 0.25)),
                book_face(&noise, small, half, true),
                book_face(&noise, small, half, false),
                globe(&noise, direction),
            ] {
                assert!(albedo.min_element() >= 0.0 && albedo.max_element() <= 1.0, "{at} {albedo}");
            }
        }
    }
}
