//! Invented results for tests of charts and tables.

use crate::results::{self, Record, SCHEMA};
use serde_json::json;

/// A successful run of (scene, variant, budget) whose other figures follow from the arguments.
pub fn record(cell: usize, (scene, variant, budget): (&str, &str, &str), seed: u64, psnr: f64) -> Record {
    let params = if variant.contains("plain") { 590_000 } else { 830_000 };
    let secs = 20.0 + cell as f64 + 0.1 * seed as f64;
    let point = |step: u32| {
        let done = f64::from(step) / 300.0;
        json!({ "step": step, "cpu_secs": secs * done, "wall_secs": secs * done,
            "psnr_test": psnr - 3.0 * (1.0 - done), "grad_psnr_test": psnr + 7.0 + done, "splats": 10_000, "texels": 0 })
    };
    let line = json!({
        "schema": SCHEMA, "key": format!("{scene}/{variant}/{budget}/{seed}"), "scene": scene, "variant": variant,
        "budget": budget, "seed": seed, "cell": cell, "status": "ok", "cores": 2, "hardware": { "cpu": "test" },
        "summary": {
            "device": { "name": "cpu" },
            "quality": { "psnr": psnr, "grad_psnr": psnr + 8.0, "ssim_3dgs": psnr / 40.0, "flip": 1.0 / psnr },
            "size": { "splats": 10_000, "sh_coefficients": 160_000, "texels": params - 590_000, "params": params, "disk": { "ltgs_tiny": params } },
            "layers_per_pixel": { "rasterised": if variant.contains("plain") { 50.0 } else { 40.0 }, "blended": 30.0 },
            "time": { "train_cpu_secs": secs, "train_wall_secs": 0.6 * secs },
            "curve": [point(100), point(200), point(300)],
        },
    });
    let (records, report) = results::parse("fixture", line.to_string().as_bytes());
    assert!(report.warnings.is_empty(), "{report:?}");
    records.into_iter().next().unwrap()
}

/// Two scenes, two variants, five seeds: "textured" is 0.5 dB better in each pair, but seeds differ by more.
pub fn records() -> Vec<Record> {
    let mut all = Vec::new();
    for seed in 1..=5_u64 {
        for (scene, base) in [("fox", 25.0), ("<b>&|,\"", 30.0)] {
            for (variant, gain) in [("plain", 0.0), ("=textured", 0.5)] {
                let noise = [0.9, -1.1, 0.4, -0.6, 1.3][seed as usize - 1];
                let wobble = 0.01 * (seed % 3) as f64;
                let psnr = base + noise + gain + if gain > 0.0 { wobble } else { 0.0 };
                all.push(record(all.len(), (scene, variant, "300 steps"), seed, psnr));
            }
        }
    }
    all
}
