//! Reads a `.glb` or `.gltf` of splats and prints its contents:
//! `cargo run --example read_glb -- scene.glb`

use litetex_exporters::{ReadLimits, gltf};
use std::path::Path;

fn main() -> litetex_exporters::Result<()> {
    let Some(path) = std::env::args().nth(1) else {
        println!("usage: read_glb FILE.glb");
        return Ok(());
    };
    let contents = gltf::read_gltf(Path::new(&path), &ReadLimits::default())?;
    let asset = &contents.asset;
    let textured = asset.maps.iter().filter(|map| map.num_texels() > 0).count();
    println!("{}", contents.format);
    println!("{} splats of SH degree {}, {textured} with a map", asset.num_splats(), asset.sh_degree);
    println!("{} texels, {} cameras", asset.num_texels(), asset.cameras.len());
    for section in &contents.sections {
        println!("{:>12} bytes {}", section.bytes, section.name);
    }
    for warning in &contents.warnings {
        println!("warning: {warning}");
    }
    Ok(())
}
