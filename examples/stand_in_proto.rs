//! proto

use litetex_gs::verify::*;
use litetex_gs::backend::RenderedImage;
use litetex_exporters::*;
use std::path::Path;
fn db(a: &[RenderedImage], b: &[RenderedImage]) -> f64 { let m: f64 = a.iter().zip(b).map(|(x,y)| Difference::of("", x, y).psnr()).sum::<f64>() / a.len() as f64; m }
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let contents = read_asset(Path::new(&args[1]), &ReadLimits::default()).unwrap();
    let scene = contents.asset;
    let bytes = std::fs::metadata(&args[1]).unwrap().len();
    let go = || true;
    let open = || Ok(Box::new(litetex_gs::cpu::CpuBackend::new(Some(1))?) as Box<dyn litetex_gs::backend::Backend>);
    let backends = Backends { statistics: &open, rendering: &open, go_on: &go };
    let training: Vec<_> = scene.cameras.iter().filter(|c| !c.held_out).cloned().collect();
    let share: f64 = args[2].parse().unwrap();
    let out = litetex_gs::stand_in::make(&scene, &training, (share * bytes as f64) as u64, &backends).unwrap();
    std::fs::write("/tmp/w/si/out.ltgs", &out).unwrap();
    let test: Vec<_> = scene.cameras.iter().filter(|c| c.held_out).cloned().collect();
    let mut r = SceneRenderer::new(open().unwrap(), &go);
    let some = evenly_spread(&training, 8);
    let whole = r.images(&scene, &some).unwrap();
    let whole_t = r.images(&scene, &test).unwrap();
    let small = read_asset(Path::new("/tmp/w/si/out.ltgs"), &ReadLimits::default()).unwrap().asset;
    let a = r.images(&small, &some).unwrap();
    let t = r.images(&small, &test).unwrap();
    println!("{} {} bytes of {}: train {:.2} test {:.2} dB", args[1], out.len(), bytes, db(&a, &whole), db(&t, &whole_t));
}
