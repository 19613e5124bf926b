//! Lists the GPUs of the machine and finds one by name.

use super::shader::{GROUP, MAX_GROUPS};
use crate::{Error, Result};
#[cfg(not(target_vendor = "apple"))]
use ash::vk;
use std::sync::OnceLock;

/// An adapter that can run the kernels.
#[derive(Clone, Debug)]
pub struct AdapterChoice {
    /// Name that selects it with `--device`.
    pub name: String,
    /// Adapter, driver and API.
    pub description: String,
    /// Whether it is hardware; software adapters are selected only by name.
    pub hardware: bool,
    /// Why it counts as software, if it does.
    pub software: Option<String>,
    pub(super) adapter: wgpu::Adapter,
}

impl AdapterChoice {
    /// Whether accesses beyond a buffer do no harm, whatever a kernel does: wgpu opens Vulkan devices with robustBufferAccess2 where
    /// the driver has it.
    #[allow(unsafe_code, reason = "wgpu does not say otherwise which extensions a driver has")]
    pub(super) fn bounds_buffers(&self) -> bool {
        #[cfg(target_vendor = "apple")]
        return false;
        #[cfg(not(target_vendor = "apple"))]
        // SAFETY: the adapter is only asked, not destroyed.
        unsafe { self.adapter.as_hal::<wgpu::hal::api::Vulkan>() }.is_some_and(|adapter| {
            let instance = adapter.shared_instance();
            let mut robustness = vk::PhysicalDeviceRobustness2FeaturesEXT::default();
            let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut robustness);
            if instance.instance_api_version() < vk::API_VERSION_1_1
                || !adapter.physical_device_capabilities().supports_extension(c"VK_EXT_robustness2")
            {
                return false;
            }
            // SAFETY: the physical device is one of this instance, which has this function from version 1.1 on.
            unsafe {
                let device = adapter.raw_physical_device();
                instance.raw_instance().get_physical_device_features2(device, &mut features);
            }
            robustness.robust_buffer_access2 == vk::TRUE
        })
    }
}

/// An adapter that cannot run the kernels.
#[derive(Clone, Debug)]
pub struct UnfitAdapter {
    /// Name that would select it with `--device`.
    pub name: String,
    /// Adapter, driver and API.
    pub description: String,
    /// Whether it is hardware.
    pub hardware: bool,
    /// The missing capabilities, with found and needed values.
    pub lacks: String,
}

fn all_adapters() -> Vec<wgpu::Adapter> {
    // One instance for the process, never dropped: loaders unload drivers with the last instance, and threads that
    // create and drop instances concurrently have crashed in calls into an unloaded driver.
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

fn describe(info: &wgpu::AdapterInfo) -> String {
    let driver = [info.driver.as_str(), info.driver_info.as_str()].join(" ");
    format!("{}, {}, {:?}", info.name, driver.trim(), info.backend)
}

/// The adapters of the machine at one moment. Enumerating them loads all drivers, some of which complain, so a program does it
/// once.
#[derive(Clone, Debug)]
pub struct Adapters {
    /// Those that can run the kernels, best first: discrete, integrated, virtual and other GPUs, then software.
    pub usable: Vec<AdapterChoice>,
    /// Those that cannot.
    pub unfit: Vec<UnfitAdapter>,
}

impl Adapters {
    /// Loads the graphics drivers and asks them for their adapters.
    pub fn enumerate() -> Self {
        let mut adapters = all_adapters();
        adapters.sort_by_key(|a| rank(&a.get_info()));
        let mut out = Self { usable: Vec::new(), unfit: Vec::new() };
        for adapter in adapters {
            let info = adapter.get_info();
            let lacks = lacks(adapter.get_downlevel_capabilities().flags, &adapter.limits());
            let (name, description) = (short_name(&info.name), describe(&info));
            let software = software(info.device_type, &[&info.name, &info.driver, &info.driver_info]);
            let hardware = software.is_none();
            if lacks.is_empty() {
                let name = out.numbered(name);
                out.usable.push(AdapterChoice { name, description, hardware, software, adapter });
            } else {
                out.unfit.push(UnfitAdapter { name, description, hardware, lacks: lacks.join(", ") });
            }
        }
        out
    }

    /// The name, with a number if usable adapters have it already.
    fn numbered(&self, name: String) -> String {
        let of_same_name = |a: &&AdapterChoice| a.name == name || a.name.starts_with(&format!("{name}#"));
        match self.usable.iter().filter(of_same_name).count() {
            0 => name,
            same => format!("{name}#{}", same + 1),
        }
    }

    /// Finds an adapter by name: `gpu` selects the first hardware adapter, any other name the adapter of that name, or
    /// the only one whose name contains it.
    ///
    /// # Errors
    /// [`Error::Unsupported`], listing the available adapters; [`Error::Usage`] for an empty name.
    pub fn find(&self, name: &str) -> Result<&AdapterChoice> {
        // An empty name, as from an unset variable in a script, is contained in every name.
        if name.trim().is_empty() {
            let known = "a name that \"litetex devices\" lists, \"auto\", \"cpu\" or \"gpu\"";
            return Err(usage!("--device: found an empty name, expected {known}"));
        }
        let wanted = name.to_lowercase();
        let found = if wanted == "gpu" {
            self.usable.iter().find(|a| a.hardware)
        } else {
            let exact = self.usable.iter().find(|a| a.name == wanted);
            let mut partial = self.usable.iter().filter(|a| a.name.contains(&wanted));
            exact.or_else(|| partial.next().filter(|_| partial.next().is_none()))
        };
        found.ok_or_else(|| Error::unsupported("--device", self.why_not_found(name, &wanted)))
    }

    fn why_not_found(&self, name: &str, wanted: &str) -> String {
        let known: Vec<String> = self.usable.iter().map(|a| format!("{:?}", a.name)).collect();
        let what = match (wanted, known.as_slice()) {
            ("gpu", []) => "no GPU and no graphics driver was found; use \"cpu\"".to_owned(),
            ("gpu", known) => {
                let known = known.join(", ");
                format!("no hardware GPU was found; use \"cpu\", or name a software driver: {known}")
            }
            (_, []) => {
                format!(
                    "no device is named {name:?}, and no graphics driver was found; use \"auto\" or \"cpu\""
                )
            }
            (_, known) => format!(
                "{name:?} matches no device, or more than one; expected \"auto\", \"cpu\", \"gpu\" or one of {}; see \
                 \"litetex devices\"",
                known.join(", ")
            ),
        };
        // Explains adapters that match but are unfit.
        let matches = |u: &&UnfitAdapter| wanted == "gpu" || u.name.contains(wanted);
        let unfit = self.unfit.iter().filter(matches);
        what + &unfit.map(|u| format!("; {:?} cannot be used: {}", u.name, u.lacks)).collect::<String>()
    }
}

/// Without validation of indirect dispatches: only our own kernels write their sizes, and validating each one would
/// cost an additional dispatch.
fn instance_flags() -> wgpu::InstanceFlags {
    let flags = wgpu::InstanceFlags::from_build_config() - wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL;
    flags.with_env()
}

/// Workgroup memory that the kernels need.
const WORKGROUP_BYTES: u32 = 16 << 10;
/// Storage buffers that a kernel binds.
const STORAGE_BUFFERS: u32 = 8;

/// Capabilities that the kernels need and an adapter lacks.
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
        ("storage buffers per kernel", limits.max_storage_buffers_per_shader_stage, STORAGE_BUFFERS),
        ("invocations per workgroup", limits.max_compute_invocations_per_workgroup, GROUP),
        ("invocations per workgroup along x", limits.max_compute_workgroup_size_x, GROUP),
        ("bytes of workgroup memory", limits.max_compute_workgroup_storage_size, WORKGROUP_BYTES),
        ("workgroups per dispatch and axis", limits.max_compute_workgroups_per_dimension, MAX_GROUPS),
    ];
    let missing = wanted.into_iter().filter(|(_, has, needed)| has < needed);
    out.extend(missing.map(|(what, has, needed)| format!("{has} {what} ({needed} needed)")));
    out
}

/// Software renderers, by words in their names or in those of their drivers. Virtual GPUs that forward to another
/// driver include its name.
const SOFTWARE: [&str; 7] =
    ["llvmpipe", "lavapipe", "softpipe", "swiftshader", "swrast", "warp", "basic render"];

/// Why an adapter counts as software; `None` for hardware. The type alone is not enough: virtual GPUs may be either.
fn software(kind: wgpu::DeviceType, names: &[&str]) -> Option<String> {
    // Whole words only: "warp" is part of other names.
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

/// A name that is easy to type: lower case, without anything in brackets. Mesa's software GPU gets the name of its
/// driver, which is better known.
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

#[cfg(test)]
mod tests {
    use super::*;
    use wgpu::DeviceType as Type;

    #[test]
    fn software_is_recognised_by_type_and_by_name() {
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
    fn an_empty_name_is_a_usage_error() {
        let none = Adapters { usable: Vec::new(), unfit: Vec::new() };
        for name in ["", "  "] {
            let error = none.find(name).unwrap_err();
            assert!(matches!(error, Error::Usage(_)), "{error}");
        }
    }

    #[test]
    fn missing_capabilities_are_listed_with_found_and_needed_values() {
        let all = wgpu::DownlevelFlags::all();
        let floor = wgpu::Limits::downlevel_defaults();
        let enough = wgpu::Limits {
            max_storage_buffers_per_shader_stage: 8,
            max_compute_workgroup_storage_size: 16 << 10,
            ..floor
        };
        assert_eq!(lacks(all, &enough), [""; 0]);
        let few = wgpu::Limits { max_storage_buffers_per_shader_stage: 4, ..enough.clone() };
        assert_eq!(lacks(all, &few), ["4 storage buffers per kernel (8 needed)"]);
        let small = wgpu::Limits {
            max_compute_invocations_per_workgroup: 128,
            max_compute_workgroup_storage_size: 8192,
            ..enough
        };
        let lacking = lacks(all - wgpu::DownlevelFlags::INDIRECT_EXECUTION, &small);
        let expected =
            ["no indirect dispatches", "128 invocations per workgroup", "8192 bytes of workgroup memory"];
        assert!(
            lacking.len() == 3 && lacking.iter().zip(expected).all(|(l, e)| l.starts_with(e)),
            "{lacking:?}"
        );
    }

    #[test]
    fn short_names_are_lower_case_without_brackets() {
        assert_eq!(short_name("llvmpipe (LLVM 15.0.6, 256 bits)"), "lavapipe");
        assert_eq!(short_name("NVIDIA H200"), "nvidia-h200");
        assert_eq!(short_name("Virtio-GPU Venus (llvmpipe (LLVM 19))"), "virtio-gpu-venus");
    }
}
