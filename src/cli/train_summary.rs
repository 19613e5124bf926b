//! The result of a training as a short table.

use litetex_gs::console::{Output, Table};
use litetex_gs::run::{EndOfGrowth, Summary};
use litetex_gs::text::{format_bytes, format_count, format_duration};
use serde_json::json;

/// The result of a training, as a short table and as `summary.json` has it.
pub fn output(s: &Summary) -> Output {
    let mut table = Table::default();
    table.row("scene", &s.scene);
    table.row("steps", format!("{} ({})", format_count(u64::from(s.steps)), s.stopped_by));
    if let Some(q) = s.quality.as_ref().map(|quality| &quality.evaluation) {
        table.row("test PSNR", format!("{:.2} dB", q.psnr));
        table.row("test gradient-PSNR", format!("{:.2} dB", q.grad_psnr));
        table.row("test SSIM (3DGS / valid)", format!("{:.4} / {:.4}", q.ssim_3dgs, q.ssim_valid));
        table.row("test FLIP", format!("{:.4}", q.flip));
        if let Some(uncovered) = q.uncovered {
            table.row("uncovered test pixels", format!("{:.2} %", 100.0 * uncovered));
        }
    }
    table.row("splats", format_count(s.size.splats as u64));
    table.row("texels", format_count(s.size.texels as u64));
    table.row("parameters", format_count(s.size.params as u64));
    if let Some(layers) = &s.layers_per_pixel {
        table.row("layers per pixel", layers.words());
    }
    let by = match s.growth.ended_by {
        Some(EndOfGrowth::Need) => Some("by need"),
        Some(EndOfGrowth::Device) => Some("at what the device holds"),
        Some(EndOfGrowth::Timetable) | None => None,
    };
    if let (Some(step), Some(by)) = (s.growth.ended_step, by) {
        table.row("growth", format!("ended at step {step} {by}"));
    }
    if let Some(disk) = &s.size.disk {
        let [balanced, tiny] = [disk.ltgs_balanced, disk.ltgs_tiny].map(|bytes| format_bytes(bytes as u64));
        table.row(".ltgs file (balanced / tiny)", format!("{balanced} / {tiny}"));
    }
    let what =
        format!("{} / {}", format_duration(s.time.train_wall_secs), format_duration(s.time.train_cpu_secs));
    table.row("training time (wall / CPU)", what);
    table.row("total time", format_duration(s.time.total_wall_secs));
    if let Some(fps) = &s.fps {
        table.row("rendering", format!("{:.1} fps at {} x {}", fps.median, fps.width_px, fps.height_px));
    }
    table.row("device", format!("{}: {}", s.device.name, s.device.description));
    Output::new(&s.schema, json!(s), table)
}
