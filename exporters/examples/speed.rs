//! Times writing and reading a synthetic scene of 200,000 splats (or SPLATS) and about 16 million texels: `cargo run --release
//! --example speed -- [EXTENSION] [QUALITY] [SPLATS]`.

use litetex_exporters::{
    AssetMap, Error, Quality, ReadLimits, Result, SplatAsset, WriteOptions, read_asset, write_asset,
};
use std::time::Instant;

/// A small generator of numbers in [0, 1).
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 16_777_216.0
    }

    /// Bell-shaped, variance 1.
    fn normal(&mut self) -> f32 {
        ((0..12).map(|_| self.uniform()).sum::<f32>()) - 6.0
    }
}

/// Splats on a bumpy sheet with noisy maps of 2 to 32 texels per side.
fn scene(num_splats: usize) -> SplatAsset {
    let mut random = Random(1);
    let mut asset = SplatAsset { sh_degree: 3, ..SplatAsset::default() };
    for _ in 0..num_splats {
        let (x, y) = (2.0 * random.uniform() - 1.0, 2.0 * random.uniform() - 1.0);
        asset.positions.push([x, y, 0.2 * (5.0 * x).sin() * (7.0 * y).cos()]);
        let q: [f32; 4] = std::array::from_fn(|_| random.normal());
        let norm = q.iter().map(|v| v * v).sum::<f32>().sqrt();
        asset.rotations.push(q.map(|v| v / norm));
        asset.scales.push([(-5.5 + 0.6 * random.normal()).exp(), (-5.5 + 0.6 * random.normal()).exp()]);
        asset.opacities.push((0.6 + 0.2 * random.normal()).clamp(0.02, 1.0));
        asset.sh_degrees.push(3);
        asset.sh.extend((0..48).map(|i| random.normal() * if i < 3 { 0.5 } else { 0.03 }));
        let side = |random: &mut Random| 2 * (1 + (12.0 * random.uniform().powi(2)) as u16);
        let (rows, cols) = (side(&mut random), side(&mut random));
        let texel_size = 3.0 * asset.scales[asset.scales.len() - 1][0] / f32::from(rows);
        let offset_texels = asset.num_texels() as u32;
        asset.maps.push(AssetMap { offset_texels, rows, cols, texel_sizes: [texel_size; 2], shift: [0; 2] });
        let num_values = 3 * usize::from(rows) * usize::from(cols);
        asset.texels.extend((0..num_values).map(|_| (0.1 * random.normal()).clamp(-1.0, 1.0)));
    }
    asset
}

/// Largest memory of the process so far, where the system tells.
fn peak_mib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok()? >> 10)
}

fn main() -> Result<()> {
    let mut args = std::env::args().skip(1);
    let extension = args.next().unwrap_or_else(|| "ltgs".to_owned());
    let quality = args.next().and_then(|a| Quality::from_name(&a)).unwrap_or_default();
    let num_splats = args.next().and_then(|a| a.parse().ok()).unwrap_or(200_000);
    let asset = scene(num_splats);
    let raw = 4 * (13 * asset.num_splats() + asset.sh.len() + asset.texels.len());
    println!("{} splats, {} texels, {} MiB", asset.num_splats(), asset.num_texels(), raw >> 20);
    println!("peak memory {:?} MiB", peak_mib());
    let path = std::env::temp_dir().join(format!("litetex_speed_{}.{extension}", std::process::id()));
    let start = Instant::now();
    let written = write_asset(&path, &asset, &WriteOptions { quality, ..WriteOptions::default() })?;
    println!(
        "{extension} {} written in {:.2} s, {} bytes",
        quality.name(),
        start.elapsed().as_secs_f64(),
        written.scene_bytes()
    );
    println!("peak memory {:?} MiB", peak_mib());
    drop(asset);
    let start = Instant::now();
    let contents = read_asset(&path, &ReadLimits::default())?;
    println!("read in {:.2} s", start.elapsed().as_secs_f64());
    println!("peak memory {:?} MiB", peak_mib());
    for section in contents.sections {
        println!("  {:12} {:>12}", section.name, section.bytes);
    }
    written.files.iter().try_for_each(|file| {
        std::fs::remove_file(file).map_err(|e| Error::Io { path: file.clone(), source: e })
    })
}
