//! Checks by naga, without a device, that the shaders agree with the table of kernels and the structures of
//! `layout`.

mod contract;
mod mirrors;
mod parsed;

use super::kernels::{KERNELS, Kernel};
use super::shader::{ExpandedShader, HALF_TILES, SEGMENTS, SOURCES, SUM_LANES, expand};
use contract::{check, workgroup_bytes};
use mirrors::{check_structs, mirrors};
use parsed::Parsed;
use std::collections::BTreeSet;

fn native(kernel: &Kernel) -> ExpandedShader {
    expand(kernel.name, kernel.flags).unwrap()
}

/// The kernel as compiled with another flag: for software drivers, or for the backward pass by subgroups.
fn with(flag: &'static str, kernel: &Kernel) -> ExpandedShader {
    expand(kernel.name, &[kernel.flags, &[flag]].concat()).unwrap()
}

/// The kernel for subgroups of each size.
fn by_lanes(kernel: &Kernel) -> impl Iterator<Item = ExpandedShader> {
    SUM_LANES.iter().map(|(_, lanes)| expand(kernel.name, &[kernel.flags, lanes].concat()).unwrap())
}

#[test]
fn kernels_agree_with_the_table() {
    let all = |kernel| [native(kernel), with(HALF_TILES, kernel), with(SEGMENTS, kernel)];
    let mut wrong: Vec<String> =
        KERNELS.iter().flat_map(|(_, k)| all(k).into_iter().flat_map(|shader| check(shader, k))).collect();
    for (_, kernel) in KERNELS.iter().filter(|(_, kernel)| kernel.needs_subgroups()) {
        wrong.extend(by_lanes(kernel).flat_map(|shader| check(shader, kernel)));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for (id, kernel) in KERNELS {
        let parsed = Parsed::new(native(kernel)).unwrap();
        println!("{id:?}: {} bytes of workgroup memory", workgroup_bytes(&parsed));
    }
}

#[test]
fn structures_agree_with_rust() {
    let mut seen = BTreeSet::new();
    let mut wrong = Vec::new();
    let kernels = KERNELS.iter().map(|(_, kernel)| native(kernel));
    // Includes the atomic variant of Status.
    let alone = [&[][..], &["ATOMIC_STATUS"]].map(|f| expand("common/status", f).unwrap());
    for expanded in kernels.chain(alone) {
        wrong.extend(check_structs(&Parsed::new(expanded).unwrap(), &mut seen));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let sorts = KERNELS.iter().any(|(_, kernel)| kernel.has_sort_pass());
    let unseen: Vec<&str> = mirrors().iter().map(|m| m.name).filter(|name| !seen.contains(name)).collect();
    assert!(unseen.is_empty() || (unseen == ["SortPass"] && !sorts), "no shader has {unseen:?}");
}

#[test]
fn injected_faults_are_detected() {
    let (_, kernel) = KERNELS.iter().find(|(_, k)| k.name == "project").unwrap();
    let planted = |original: &str, replacement: &str| {
        let mut expanded = native(kernel);
        assert!(expanded.text.contains(original), "{original:?} is missing");
        expanded.text = expanded.text.replacen(original, replacement, 1);
        check(expanded, kernel).join("\n")
    };
    assert_eq!(planted("sh_degree: u32", "sh_degree: u32"), "");
    let detected = |original: &str, replacement: &str, place: &str, what: &str| {
        let found = planted(original, replacement);
        assert!(found.contains(place) && found.contains(what), "{replacement:?}: {found:?}");
    };
    let step = "shaders/common/step.wgsl:";
    let source = SOURCES.iter().find(|(name, _)| *name == "common/step").unwrap().1;
    let line = source.lines().position(|l| l == "    rate_sh_dc: f32,");
    detected(
        "    rate_sh_dc: f32,\n    rate_sh_rest: f32,",
        "    rate_sh_rest: f32,\n    rate_sh_dc: f32,",
        &format!("{step}{}: ", line.unwrap() + 1),
        "Step member 32",
    );
    detected("    loss_l1: f32,", "    loss_l1: u32,", step, "Step member 21");
    detected("    grid: vec2u,", "    grid: vec4u,", step, "bytes");
    let project = "shaders/project.wgsl:";
    detected(
        "const EDGE_ON_MIN: f32 = 0.001;",
        "const EDGE_ON_MIN: f32 = 0.00100001;",
        project,
        "EDGE_ON_MIN",
    );
    detected("const FLAG_STATISTICS = 2u", "const FLAG_STATISTICS = 8u", step, "FLAG_STATISTICS");
    detected("const OPACITY = 9u", "const OPACITY = 10u", "shaders/common/splat.wgsl:", "OPACITY");
    let extra = "@group(0) @binding(8) var<storage, read> extra: array<f32>; @compute @workgroup_size(GROUP)";
    detected("@compute @workgroup_size(GROUP)", extra, project, "extra");
    detected("@group(0) @binding(7)", "@group(0) @binding(9)", project, "group_lists");
    detected("@group(0) @binding(4)", "@group(1) @binding(4)", project, "splat_info");
    detected("read> splat_info", "read_write> splat_info", project, "splat_info");
    detected("read_write> bounds: ", "read> bounds: ", project, "bounds");
    detected(
        "@workgroup_size(GROUP)",
        "@workgroup_size(GROUP, 1, 2)",
        project.trim_end_matches(':'),
        "workgroups of",
    );
    detected("fn project(", "fn projects(", "shaders/project.wgsl", "entry points");
    detected("first_float(splat_info[i]", "first_float(nonsense[i]", project, "nonsense");
    let hoard = "var<workgroup> hoard: array<vec4f, 1025>; @compute @workgroup_size(GROUP)";
    let write = "bounds[i] = footprint;";
    let used = format!("hoard[0] = vec4f(); {write}");
    let mut expanded = native(kernel);
    assert!(expanded.text.contains(write), "{write:?} is missing");
    expanded.text = expanded.text.replace("@compute @workgroup_size(GROUP)", hoard).replace(write, &used);
    // 48 bytes more than the hoard: those that the kernel has itself.
    assert!(check(expanded, kernel).join("\n").contains("16448 bytes of workgroup memory"));
    let mut one_less = *kernel;
    one_less.bindings = &kernel.bindings[..6];
    assert!(check(native(kernel), &one_less).join("\n").contains("group_lists"));
}

/// Collects the names of all shaders below a directory, without the extension.
fn files_below(directory: &std::path::Path, prefix: &str, out: &mut BTreeSet<String>) {
    for entry in std::fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        let name = format!("{prefix}{}", path.file_stem().unwrap().to_str().unwrap());
        if path.is_dir() {
            files_below(&path, &format!("{name}/"), out);
        } else if path.extension().is_some_and(|e| e == "wgsl") {
            out.insert(name);
        }
    }
}

#[test]
fn every_shader_file_is_listed_and_every_kernel_has_one() {
    let mut files = BTreeSet::new();
    files_below(&std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders"), "", &mut files);
    let listed: BTreeSet<String> = SOURCES.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(listed.len(), SOURCES.len(), "a file is listed twice");
    assert_eq!(files, listed);
    let entries: BTreeSet<&str> =
        files.iter().map(String::as_str).filter(|f| !f.starts_with("common/")).collect();
    let kernels: BTreeSet<&str> = KERNELS.iter().map(|(_, kernel)| kernel.name).collect();
    assert_eq!(entries, kernels);
}

#[test]
fn expanded_kernels_have_their_entry_point_and_no_directives() {
    for (_, kernel) in KERNELS {
        let text = expand(kernel.name, kernel.flags).unwrap().text;
        assert!(text.contains(&format!("fn {}(", kernel.name)));
        assert!(!text.lines().any(|l| l.trim_start().starts_with('#')), "{}", kernel.name);
    }
}
