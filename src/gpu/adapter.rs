//! Which GPUs there are, and which one a name means.

use crate::{Error, Result};

/// An adapter as `litetex devices` shows it.
#[derive(Clone, Debug)]
pub struct AdapterChoice {
    /// What `--device` takes for it.
    pub name: String,
    /// Adapter, driver and API.
    pub description: String,
    /// Whether it is hardware: software adapters are taken only by name.
    pub hardware: bool,
    pub(super) adapter: wgpu::Adapter,
}

/// All adapters that can run the kernels, best first: discrete, integrated and virtual GPUs, software.
pub fn list_adapters() -> Vec<AdapterChoice> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12,
        flags: instance_flags(),
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let mut adapters: Vec<wgpu::Adapter> = adapters.into_iter().filter(can_compute).collect();
    adapters.sort_by_key(|a| rank(a.get_info().device_type));
    let mut out: Vec<AdapterChoice> = Vec::new();
    for adapter in adapters {
        let info = adapter.get_info();
        let base = short_name(&info.name);
        let same = out.iter().filter(|o| o.name == base || o.name.starts_with(&format!("{base}#"))).count();
        let name = if same == 0 { base } else { format!("{base}#{}", same + 1) };
        let driver = [info.driver.as_str(), info.driver_info.as_str()].join(" ");
        out.push(AdapterChoice {
            name,
            description: format!("{}, {}, {:?}", info.name, driver.trim(), info.backend),
            hardware: info.device_type != wgpu::DeviceType::Cpu,
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

fn can_compute(adapter: &wgpu::Adapter) -> bool {
    let downlevel = adapter.get_downlevel_capabilities();
    let needed = wgpu::DownlevelFlags::COMPUTE_SHADERS | wgpu::DownlevelFlags::INDIRECT_EXECUTION;
    let limits = adapter.limits();
    downlevel.flags.contains(needed)
        && limits.max_storage_buffers_per_shader_stage >= 8
        && limits.max_compute_invocations_per_workgroup >= super::shader::GROUP
}

fn rank(kind: wgpu::DeviceType) -> u32 {
    match kind {
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
/// [`Error::Unsupported`] with what there is.
pub fn find_adapter(name: &str) -> Result<AdapterChoice> {
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
    Err(Error::unsupported("--device", what))
}
