//! What AMD's code for the kernels is like, by the compiler of Mesa's RADV driver, without a GPU: registers, workgroup memory,
//! instructions, and the compiler's estimate of the cycles that a wave occupies the hardware. Prints a Markdown table.
//!
//!     scripts/amd-code.sh [FILE.wgsl]...
//!
//! Without files, all kernels; files must be expanded, and named after their entry points up to a dot. wgpu cannot open the
//! driver's null device, so that the pipelines are made with Vulkan itself, and the code with naga by the options of wgpu.
#![allow(unsafe_code, reason = "Vulkan")]

use ash::vk;
use naga::back::spv;
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use std::error::Error;
use std::ffi::CString;
use std::path::Path;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Statistics of the table, by RADV's names.
const COLUMNS: [(&str, &str); 4] = [
    ("VGPRs", "registers"),
    ("LDS Size", "workgroup memory, bytes"),
    ("Instructions", "instructions"),
    (INVERSE, "cycles"),
];
const INVERSE: &str = "Inverse Throughput";

/// Highest binding of a storage buffer, and the uniforms.
const STORAGE_BINDINGS: u32 = 10;
const UNIFORM_BINDINGS: [u32; 2] = [0, 15];

/// A kernel as WGSL.
struct Kernel {
    name: String,
    entry_point: String,
    text: String,
}

fn main() -> Result<()> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    let kernels = if files.is_empty() {
        all_kernels()?
    } else {
        files.iter().map(|f| of_file(f)).collect::<Result<_>>()?
    };
    let device = Device::open()?;
    println!("{}\n", device.name);
    let titles = COLUMNS.map(|(_, title)| title).join(" | ");
    println!("| kernel | {titles} | with clamped indices |\n|---|{}", "---|".repeat(COLUMNS.len() + 1));
    for kernel in &kernels {
        let statistics = device.statistics(kernel, BoundsCheckPolicy::Unchecked)?;
        let clamped = device.statistics(kernel, BoundsCheckPolicy::Restrict)?;
        let value = |of: &[(String, u64)], name: &str| {
            of.iter()
                .find(|(found, _)| found.eq_ignore_ascii_case(name))
                .map_or("?".into(), |(_, v)| v.to_string())
        };
        let cells = COLUMNS.map(|(name, _)| value(&statistics, name)).join(" | ");
        println!("| `{}` | {cells} | {} |", kernel.name, value(&clamped, INVERSE));
    }
    Ok(())
}

fn all_kernels() -> Result<Vec<Kernel>> {
    let shaders = litetex_gs::gpu::all_shaders()?;
    // Hardware gets tiles of the full height.
    let of_hardware = shaders.into_iter().filter(|shader| !shader.name.contains("HALF_TILES"));
    Ok(of_hardware
        .map(|shader| Kernel {
            name: shader.name,
            entry_point: shader.entry_point.to_owned(),
            text: shader.shader.text,
        })
        .collect())
}

fn of_file(file: &str) -> Result<Kernel> {
    let name = Path::new(file).file_stem().ok_or("a file without a name")?.to_string_lossy().into_owned();
    let entry_point = name.split('.').next().unwrap_or(&name).to_owned();
    let text = std::fs::read_to_string(file).map_err(|e| format!("{file}: {e}"))?;
    Ok(Kernel { name, entry_point, text })
}

/// SPIR-V with the options by which wgpu compiles the kernels where buffers are checked by the device.
fn compiled(kernel: &Kernel, index: BoundsCheckPolicy) -> Result<Vec<u32>> {
    let module = naga::front::wgsl::parse_str(&kernel.text).map_err(|e| e.emit_to_string(&kernel.text))?;
    let flags = naga::valid::ValidationFlags::all();
    let info = naga::valid::Validator::new(flags, naga::valid::Capabilities::SUBGROUP)
        .validate(&module)
        .map_err(|e| e.emit_to_string(&kernel.text))?;
    let unchecked = BoundsCheckPolicy::Unchecked;
    let options = spv::Options {
        lang_version: (1, 5),
        emit_int_div_checks: false,
        flags: spv::WriterFlags::empty(),
        force_loop_bounding: false,
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
        bounds_check_policies: BoundsCheckPolicies {
            index,
            buffer: unchecked,
            image_load: unchecked,
            binding_array: unchecked,
        },
        ..spv::Options::default()
    };
    Ok(spv::write_vec(&module, &info, &options, None)?)
}

/// The null device.
struct Device {
    name: String,
    device: ash::Device,
    executables: ash::khr::pipeline_executable_properties::Device,
    layout: vk::PipelineLayout,
    // Dropped last: unloads the driver.
    _instance: ash::Instance,
    _entry: ash::Entry,
}

impl Device {
    fn open() -> Result<Self> {
        // SAFETY: calls as the Vulkan specification has them; all handles live until the process ends.
        unsafe {
            let entry = ash::Entry::load()?;
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
            let info = vk::InstanceCreateInfo::default().application_info(&application);
            let instance = entry.create_instance(&info, None)?;
            let physical =
                *instance.enumerate_physical_devices()?.first().ok_or("no device: is RADV installed?")?;
            let properties = instance.get_physical_device_properties(physical);
            let name = properties.device_name_as_c_str()?.to_string_lossy().into_owned();
            let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
            let extensions = [ash::khr::pipeline_executable_properties::NAME.as_ptr()];
            let mut info_feature = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default()
                .pipeline_executable_info(true);
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&extensions)
                .push_next(&mut info_feature);
            let device = instance.create_device(physical, &info, None)?;
            let executables = ash::khr::pipeline_executable_properties::Device::new(&instance, &device);
            let binding = |binding: u32| {
                let kind = if UNIFORM_BINDINGS.contains(&binding) {
                    vk::DescriptorType::UNIFORM_BUFFER_DYNAMIC
                } else {
                    vk::DescriptorType::STORAGE_BUFFER
                };
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding)
                    .descriptor_type(kind)
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            };
            let bindings: Vec<_> = (1..=STORAGE_BINDINGS).chain(UNIFORM_BINDINGS).map(binding).collect();
            let set = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
            let sets = [device.create_descriptor_set_layout(&set, None)?];
            let layout = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
            let layout = device.create_pipeline_layout(&layout, None)?;
            Ok(Self { name, device, executables, layout, _instance: instance, _entry: entry })
        }
    }

    /// What the compiler says of a kernel.
    fn statistics(&self, kernel: &Kernel, index: BoundsCheckPolicy) -> Result<Vec<(String, u64)>> {
        let words = compiled(kernel, index).map_err(|e| format!("{}: {e}", kernel.name))?;
        let entry_point = CString::new(kernel.entry_point.as_str())?;
        // SAFETY: as above; the code was validated.
        unsafe {
            let module = self
                .device
                .create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&words), None)?;
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(&entry_point);
            let info = vk::ComputePipelineCreateInfo::default()
                .flags(vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR)
                .stage(stage)
                .layout(self.layout);
            let pipeline = self
                .device
                .create_compute_pipelines(vk::PipelineCache::null(), &[info], None)
                .map_err(|(_, error)| error)?[0];
            let executable = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline);
            let found = self.executables.get_pipeline_executable_statistics(&executable)?;
            let statistic = |s: &vk::PipelineExecutableStatisticKHR<'_>| -> Result<(String, u64)> {
                Ok((s.name_as_c_str()?.to_string_lossy().into_owned(), s.value.u64))
            };
            found.iter().map(statistic).collect()
        }
    }
}
