//! The rules that every shader must follow. Each check returns a list of violations; naga parses and validates.

use super::mirrors::check_structs;
use super::parsed::Parsed;
use crate::gpu::kernels::{Kernel, SORT_PASS_BINDING};
use crate::gpu::layout;
use crate::gpu::shader::{ExpandedShader, GROUP, shared_constants};
use crate::model::SplatGroup;

use naga::{AddressSpace, Expression, Literal, StorageAccess};
use std::collections::{BTreeMap, BTreeSet};

/// Minimum limits of WebGPU.
const MAX_STORAGE_BUFFERS: usize = 8;
const MAX_WORKGROUP_BYTES: u32 = 16 << 10;

/// Every constant that the shaders share with Rust, by name.
fn all_constants() -> BTreeMap<&'static str, Literal> {
    let (floats, integers) = shared_constants();
    let mut out: BTreeMap<_, _> = floats.iter().map(|&(n, v)| (n, Literal::F32(v as f32))).collect();
    out.extend(integers.iter().map(|&(n, v)| (n, Literal::U32(v))));
    let of_layout = [
        ("PAIR_SUMS", layout::PAIR_SUMS),
        ("PAIR_SUMS_STATISTICS", layout::PAIR_SUMS_STATISTICS),
        ("PAIR_SUMS_GEOMETRY", layout::PAIR_SUMS_GEOMETRY),
        ("FLAG_PERSIST", layout::FLAG_PERSIST),
        ("FLAG_STATISTICS", layout::FLAG_STATISTICS),
        ("FLAG_ALL_MAPS", layout::FLAG_ALL_MAPS),
        ("FLAG_SECOND_MOMENTS", layout::FLAG_SECOND_MOMENTS),
        ("FLAG_COUNT_ATOMICS", layout::FLAG_COUNT_ATOMICS),
        ("FLAG_INVISIBLE", layout::FLAG_INVISIBLE),
        ("FLAG_NO_VIEW", layout::FLAG_NO_VIEW),
        ("CHANGE_SAME", layout::CHANGE_SAME),
        ("CHANGE_FINER", layout::CHANGE_FINER),
        ("CHANGE_COARSER", layout::CHANGE_COARSER),
        ("CHANGE_RESAMPLE", layout::CHANGE_RESAMPLE),
    ];
    out.extend(of_layout.map(|(n, v)| (n, Literal::U32(v))));
    let mut offset = 0;
    for (name, group) in
        ["POSITION", "QUATERNION", "LOG_SCALE", "OPACITY", "SH"].into_iter().zip(SplatGroup::ALL)
    {
        out.insert(name, Literal::U32(offset));
        offset += group.width(0) as u32;
    }
    out
}

/// Constants whose value differs from Rust's.
fn check_constants(parsed: &Parsed) -> Vec<String> {
    let shared = all_constants();
    let module = &parsed.module;
    let mut wrong = Vec::new();
    for (handle, constant) in module.constants.iter() {
        let Some((name, expected)) = constant.name.as_deref().and_then(|n| shared.get_key_value(n)) else {
            continue;
        };
        let found = &module.global_expressions[constant.init];
        if !matches!(found, Expression::Literal(found) if found == expected) {
            let at = parsed.at(module.constants.get_span(handle));
            wrong.push(format!("{at}: {name} is {found:?}, in Rust {expected:?}"));
        }
    }
    wrong
}

/// Name and access of a binding.
type NamedAccess = (String, &'static str);

/// Bindings that differ from the table, and bound storage that the kernel does not use.
fn check_bindings(parsed: &Parsed, kernel: &Kernel) -> Vec<String> {
    let mut expected: BTreeMap<u32, NamedAccess> = BTreeMap::from([(0, ("step".into(), "uniform Step"))]);
    for (binding, bound) in (1..).zip(kernel.bindings) {
        expected.insert(binding, (bound.name.into(), if bound.writes { "read_write" } else { "read" }));
    }
    if kernel.has_sort_pass() {
        expected.insert(SORT_PASS_BINDING, ("sort_pass".into(), "uniform SortPass"));
    }
    let mut wrong = Vec::new();
    for (handle, variable) in parsed.module.global_variables.iter() {
        let Some(place) = variable.binding else { continue };
        let access = match variable.space {
            AddressSpace::Uniform => match parsed.module.types[variable.ty].name.as_deref() {
                Some("Step") => "uniform Step",
                Some("SortPass") => "uniform SortPass",
                _ => "another uniform",
            },
            AddressSpace::Storage { access } if access == StorageAccess::LOAD => "read",
            AddressSpace::Storage { access } if access == StorageAccess::LOAD | StorageAccess::STORE => {
                "read_write"
            }
            _ => "neither uniform nor storage",
        };
        let found = Some((variable.name.clone().unwrap_or_default(), access));
        let expected = (place.group == 0).then(|| expected.remove(&place.binding)).flatten();
        let at = parsed.variable_at(handle);
        if found != expected {
            wrong.push(format!("{at}: {place:?} is {found:?}, in the table {expected:?}"));
        } else if !parsed.is_used(handle) && !access.starts_with("uniform") {
            wrong.push(format!("{at}: {found:?} is bound but not used"));
        }
    }
    wrong.extend(
        expected.iter().map(|e| format!("shaders/{}.wgsl: {e:?} is missing, but in the table", kernel.name)),
    );
    if kernel.bindings.len() > MAX_STORAGE_BUFFERS {
        wrong.push(format!("shaders/{}.wgsl: {} storage buffers", kernel.name, kernel.bindings.len()));
    }
    wrong
}

/// Violations by the entry point, its workgroup size and its workgroup memory.
fn check_entry(parsed: &Parsed, kernel: &Kernel) -> Vec<String> {
    let file = format!("shaders/{}.wgsl", kernel.name);
    let entries = &parsed.module.entry_points;
    let names: Vec<&str> = entries.iter().map(|e| e.name.as_str()).collect();
    if names != [kernel.name] {
        return vec![format!("{file}: entry points {names:?}, expected only {:?}", kernel.name)];
    }
    let mut wrong = Vec::new();
    let [x, y, z] = entries[0].workgroup_size;
    if x > GROUP || y != 1 || z != 1 {
        wrong.push(format!("{file}: workgroups of {:?}", entries[0].workgroup_size));
    }
    let bytes = workgroup_bytes(parsed);
    if bytes > MAX_WORKGROUP_BYTES {
        wrong.push(format!("{file}: {bytes} bytes of workgroup memory"));
    }
    wrong
}

/// Workgroup memory as WebGPU counts it: each variable in use, rounded up to a multiple of 16 bytes.
pub(super) fn workgroup_bytes(parsed: &Parsed) -> u32 {
    let shared = parsed.module.global_variables.iter().filter(|(_, v)| v.space == AddressSpace::WorkGroup);
    let used = shared.filter(|(handle, _)| parsed.is_used(*handle));
    used.map(|(_, v)| parsed.layouter[v.ty].size.next_multiple_of(16)).sum()
}

/// All violations by a kernel.
pub(super) fn check(expanded: ExpandedShader, kernel: &Kernel) -> Vec<String> {
    let parsed = match Parsed::new(expanded) {
        Ok(parsed) => parsed,
        Err(e) => return vec![e],
    };
    let mut wrong = check_entry(&parsed, kernel);
    if wrong.is_empty() {
        wrong.extend(check_bindings(&parsed, kernel));
    }
    wrong.extend(check_structs(&parsed, &mut BTreeSet::new()));
    wrong.extend(check_constants(&parsed));
    wrong
}
