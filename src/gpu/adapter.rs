//! Which GPUs there are, and which one a name means.

use super::shader::{GROUP, MAX_GROUPS};
use crate::{Error, Result};
use std::sync::OnceLock;

/// An adapter as `litetex devices` shows it.
#[derive(Clone, Debug)]
pub struct AdapterChoice {
    /// What `--device` takes for it.
    pub name: String,
    /// Adapter, driver and API.
    pub description: String,
    /// Whether it is hardware: software adapters are taken only by name.
    pub hardware: bool,
    /// What betrays that it computes on the processor, if it is not hardware.
    pub software: Option<String>,
    pub(super) adapter: wgpu::Adapter,
}

/// An adapter that cannot run the kernels.
#[derive(Clone, Debug)]
pub struct UnfitAdapter {
    /// What `--device` would take for it.
    pub name: String,
    /// Adapter, driver and API.
    pub description: String,
    /// Whether it is hardware.
    pub hardware: bool,
    /// What it lacks, with what it has and what is needed.
    pub lacks: String,
}

fn all_adapters() -> Vec<wgpu::Adapter> {
    // One for the process, never dropped: loaders unload drivers with their last instance, and threads that make and drop
    // instances at once have been seen to end in a call into a driver that was gone.
    static INSTANCE: OnceLock<wgpu::Instance> = OnceLock::new();
    let instance = INSTANCE.get_or_init(|| {
        wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12,
            flags: instance_flags(),
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        })
    });
    pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()))
}

/// What an adapter lacks.
fn lacks_of(adapter: &wgpu::Adapter) -> Vec<String> {
    lacks(adapter.get_downlevel_capabilities().flags, &adapter.limits())
}

fn describe(info: &wgpu::AdapterInfo) -> String {
    let driver = [info.driver.as_str(), info.driver_info.as_str()].join(" ");
    format!("{}, {}, {:?}", info.name, driver.trim(), info.backend)
}

/// Adapters that cannot run the kernels, and why.
pub fn unfit_adapters() -> Vec<UnfitAdapter> {
    let unfit = all_adapters().into_iter().filter_map(|adapter| {
        let (info, lacks) = (adapter.get_info(), lacks_of(&adapter));
        let unfit = UnfitAdapter {
            name: short_name(&info.name),
            description: describe(&info),
            hardware: software(info.device_type, &[&info.name, &info.driver, &info.driver_info]).is_none(),
            lacks: lacks.join(", "),
        };
        (!lacks.is_empty()).then_some(unfit)
    });
    unfit.collect()
}

/// All adapters that can run the kernels, best first: discrete, integrated and virtual GPUs, software.
pub fn list_adapters() -> Vec<AdapterChoice> {
    let mut adapters = all_adapters();
    adapters.retain(|adapter| lacks_of(adapter).is_empty());
    adapters.sort_by_key(|a| rank(&a.get_info()));
    let mut out: Vec<AdapterChoice> = Vec::new();
    for adapter in adapters {
        let info = adapter.get_info();
        let base = short_name(&info.name);
        let same = out.iter().filter(|o| o.name == base || o.name.starts_with(&format!("{base}#"))).count();
        let name = if same == 0 { base } else { format!("{base}#{}", same + 1) };
        let driver = [info.driver.as_str(), info.driver_info.as_str()].join(" ");
        let software = software(info.device_type, &[&info.name, &driver]);
        out.push(AdapterChoice {
            name,
            description: describe(&info),
            hardware: software.is_none(),
            software,
            adapter,
        });
    }
    out
}

/// Our indirect dispatches are written by our own kernels: validating each would cost a dispatch more.
fn instance_flags() -> wgpu::InstanceFlags {
    let flags = wgpu::InstanceFlags::from_build_config() - wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL;
    flags.with_env()
}

/// Workgroup memory that the kernels need, and storage buffers that one of them binds.
const WORKGROUP_BYTES: u32 = 16 << 10;
const STORAGE_BUFFERS: u32 = 8;

/// What the kernels need and an adapter with these capabilities does not have.
fn lacks(flags: wgpu::DownlevelFlags, limits: &wgpu::Limits) -> Vec<String> {
    let mut out = Vec::new();
    let abilities = [
        (wgpu::DownlevelFlags::COMPUTE_SHADERS, "compute shaders"),
        (wgpu::DownlevelFlags::INDIRECT_EXECUTION, "indirect dispatches"),
    ];
    out.extend(
        abilities.iter().filter(|(flag, _)| !flags.contains(*flag)).map(|(_, what)| format!("no {what}")),
    );
    let wanted = [
        ("storage buffers of a kernel", limits.max_storage_buffers_per_shader_stage, STORAGE_BUFFERS),
        ("invocations of a workgroup", limits.max_compute_invocations_per_workgroup, GROUP),
        ("invocations of a workgroup along x", limits.max_compute_workgroup_size_x, GROUP),
        ("bytes of workgroup memory", limits.max_compute_workgroup_storage_size, WORKGROUP_BYTES),
        ("workgroups of a dispatch along an axis", limits.max_compute_workgroups_per_dimension, MAX_GROUPS),
    ];
    let missing = wanted.into_iter().filter(|(_, has, needed)| has < needed);
    out.extend(missing.map(|(what, has, needed)| format!("{has} {what}, {needed} are needed")));
    out
}

/// Renderers that run on the processor, by words of their names or of their drivers' names. What forwards to
/// another driver, as virtual GPUs do, carries its name along.
const SOFTWARE: [&str; 7] =
    ["llvmpipe", "lavapipe", "softpipe", "swiftshader", "swrast", "warp", "basic render"];

/// What says that an adapter computes on the processor; `None` if nothing does. A virtual GPU may be either, and
/// says nothing of it in its type.
fn software(kind: wgpu::DeviceType, names: &[&str]) -> Option<String> {
    // Words alone: "warp" is part of other names.
    let words = |text: &str| {
        let plain = text.to_lowercase().replace(|c: char| !c.is_alphanumeric(), " ");
        format!(" {} ", plain.split_whitespace().collect::<Vec<_>>().join(" "))
    };
    let known = SOFTWARE
        .into_iter()
        .find(|software| names.iter().any(|name| words(name).contains(&format!(" {software} "))));
    match known {
        Some(known) => Some(format!("{known:?} in its name")),
        None => (kind == wgpu::DeviceType::Cpu).then(|| "its type is \"Cpu\"".to_owned()),
    }
}

fn rank(info: &wgpu::AdapterInfo) -> u32 {
    if software(info.device_type, &[&info.name, &info.driver, &info.driver_info]).is_some() {
        return 4;
    }
    match info.device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

/// A name to type: lower case, without what stands in brackets; Mesa's software GPU goes by the name of the
/// driver that everybody knows.
fn short_name(name: &str) -> String {
    let name = name.to_lowercase();
    if name.starts_with("llvmpipe") {
        return "lavapipe".into();
    }
    if name.starts_with("swiftshader") {
        return "swiftshader".into();
    }
    let plain = name.split('(').next().unwrap_or_default().trim();
    plain.split_whitespace().collect::<Vec<_>>().join("-")
}

/// The adapter that `name` means: `gpu` is the first that is hardware, else the one of that name or the only
/// one whose name contains it.
///
/// # Errors
/// [`Error::Unsupported`] with what there is; [`Error::Usage`] for an empty name.
pub fn find_adapter(name: &str) -> Result<AdapterChoice> {
    // Every name contains the empty one, which an unset variable of a script makes.
    if name.trim().is_empty() {
        let known = "a name that \"litetex devices\" lists, \"auto\", \"cpu\" or \"gpu\"";
        return Err(Error::Usage(format!("--device: found an empty name, expected {known}")));
    }
    let all = list_adapters();
    let wanted = name.to_lowercase();
    let found = if wanted == "gpu" {
        all.iter().find(|a| a.hardware)
    } else {
        let exact = all.iter().find(|a| a.name == wanted);
        let mut partial = all.iter().filter(|a| a.name.contains(&wanted));
        exact.or_else(|| partial.next().filter(|_| partial.next().is_none()))
    };
    if let Some(found) = found {
        return Ok(found.clone());
    }
    // What is there and cannot serve says why.
    let unfit = unfit_adapters();
    let meant = |u: &&UnfitAdapter| wanted == "gpu" || u.name.contains(&wanted);
    let unfit: Vec<String> =
        unfit.iter().filter(meant).map(|u| format!("; {:?} cannot be used: {}", u.name, u.lacks)).collect();
    let unfit = unfit.concat();
    let known: Vec<String> = all.iter().map(|a| format!("{:?}", a.name)).collect();
    let what = match (wanted.as_str(), known.as_slice()) {
        ("gpu", []) => "no GPU and no graphics driver was found; use \"cpu\"".to_owned(),
        ("gpu", known) => {
            format!("no hardware GPU was found; use \"cpu\", or software by name: {}", known.join(", "))
        }
        (_, []) => {
            format!("{name:?} is not a device here; there is \"auto\" and \"cpu\", and no graphics driver")
        }
        (_, known) => format!(
            "{name:?} is not a device here, or not the only one of that name; there is \"auto\", \"cpu\", \
             \"gpu\", {}; see \"litetex devices\"",
            known.join(", ")
        ),
    };
    Err(Error::unsupported("--device", what + &unfit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use wgpu::DeviceType as Type;

    #[test]
    fn software_is_told_from_hardware_by_type_and_by_name() {
        let software_ones = [
            (Type::Cpu, "llvmpipe (LLVM 15.0.6, 256 bits)", "llvmpipe Mesa 22.3.6"),
            (Type::VirtualGpu, "Virtio-GPU Venus (llvmpipe (LLVM 19.1.7, 256 bits))", "venus Mesa 25.0.7"),
            (Type::Other, "SwiftShader Device (LLVM 10.0.0)", "SwiftShader driver 5.0.0"),
            (Type::IntegratedGpu, "Microsoft Basic Render Driver", "10.0.26100"),
            (Type::Other, "Microsoft Direct3D12 (WARP)", "Dozen"),
            (Type::Cpu, "something new", "of its own"),
        ];
        for (kind, name, driver) in software_ones {
            assert!(software(kind, &[name, driver]).is_some(), "{name}");
        }
        let hardware_ones = [
            (Type::DiscreteGpu, "NVIDIA H200", "NVIDIA 570.86"),
            (Type::VirtualGpu, "Virtio-GPU Venus (AMD Radeon 780M (RADV PHOENIX))", "venus Mesa 25.0.7"),
            (Type::VirtualGpu, "NVIDIA A10-24Q", "NVIDIA 550.54"),
            (Type::Other, "Warpspeed 3000", "warpdriver"),
        ];
        for (kind, name, driver) in hardware_ones {
            assert_eq!(software(kind, &[name, driver]), None, "{name}");
        }
    }

    #[test]
    fn an_empty_name_means_nothing() {
        for name in ["", "  "] {
            let error = find_adapter(name).unwrap_err();
            assert!(matches!(error, Error::Usage(_)), "{error}");
        }
    }

    #[test]
    fn what_an_adapter_lacks_is_named_with_numbers() {
        let all = wgpu::DownlevelFlags::all();
        let floor = wgpu::Limits::downlevel_defaults();
        let enough = wgpu::Limits {
            max_storage_buffers_per_shader_stage: 8,
            max_compute_workgroup_storage_size: 16 << 10,
            ..floor
        };
        assert_eq!(lacks(all, &enough), [""; 0]);
        let few = wgpu::Limits { max_storage_buffers_per_shader_stage: 4, ..enough.clone() };
        assert_eq!(lacks(all, &few), ["4 storage buffers of a kernel, 8 are needed"]);
        let small = wgpu::Limits {
            max_compute_invocations_per_workgroup: 128,
            max_compute_workgroup_storage_size: 8192,
            ..enough
        };
        let lacking = lacks(all - wgpu::DownlevelFlags::INDIRECT_EXECUTION, &small);
        let expected =
            ["no indirect dispatches", "128 invocations of a workgroup", "8192 bytes of workgroup memory"];
        assert!(
            lacking.len() == 3 && lacking.iter().zip(expected).all(|(l, e)| l.starts_with(e)),
            "{lacking:?}"
        );
    }

    #[test]
    fn names_to_type() {
        assert_eq!(short_name("llvmpipe (LLVM 15.0.6, 256 bits)"), "lavapipe");
        assert_eq!(short_name("NVIDIA H200"), "nvidia-h200");
        assert_eq!(short_name("Virtio-GPU Venus (llvmpipe (LLVM 19))"), "virtio-gpu-venus");
    }
}
