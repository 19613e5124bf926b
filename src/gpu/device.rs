//! An open device: buffers within its limits, pipelines, waiting and reading back. Everything that can fail
//! in a driver becomes a typed error here.

use super::adapter::AdapterChoice;
use super::kernels::{Binding, KERNELS, Kernel, KernelId, SORT_PASS_BINDING};
use super::layout::{SortPass, StepUniform};
use super::shader::{Dialect, expand};
use crate::{Error, Result};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// Which limits are asked of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LimitChoice {
    /// All that the adapter has.
    Adapter,
    /// The floor: 8 storage buffers, 16 KiB of workgroup memory, bindings of 128 MiB.
    Downlevel,
    /// The floor, with buffers of at most so many bytes: for tests of what does not fit.
    Buffers(u64),
}

/// A compiled kernel.
pub(super) struct Pipeline {
    pub pipeline: wgpu::ComputePipeline,
    pub layout: wgpu::BindGroupLayout,
}

/// What the driver said outside of any call.
#[derive(Clone, Debug, Default)]
struct DriverErrors {
    /// Why the device is gone.
    lost: Option<String>,
    /// The first uncaptured error: something that was asked has not been done.
    refused: Option<String>,
}

/// The first of each kind.
type SharedErrors = Arc<Mutex<DriverErrors>>;

/// What was asked of a device, counted where it is asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DeviceWork {
    /// Dispatches.
    pub dispatches: u64,
    /// Submissions of command buffers, copies to staging buffers included.
    pub submissions: u64,
    /// Times that the host waited for the device.
    pub waits: u64,
}

/// Counters behind [`DeviceWork`].
#[derive(Default)]
struct WorkCounters {
    dispatches: AtomicU64,
    submissions: AtomicU64,
    waits: AtomicU64,
}

/// An open device.
pub struct GpuDevice {
    /// Name and description.
    pub choice: AdapterChoice,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) limits: wgpu::Limits,
    fault: SharedErrors,
    work: WorkCounters,
}

/// Bytes between entries that are bound at dynamic offsets: the largest alignment that a device may ask for.
pub(super) const UNIFORM_STRIDE: u64 = 256;

impl GpuDevice {
    /// Opens an adapter.
    ///
    /// # Errors
    /// [`Error::Device`] if the driver refuses.
    pub fn open(choice: &AdapterChoice, limits: LimitChoice) -> Result<Self> {
        let adapter = &choice.adapter;
        let required_limits = match limits {
            LimitChoice::Adapter => adapter.limits(),
            LimitChoice::Downlevel => downlevel(&adapter.limits()),
            LimitChoice::Buffers(bytes) => wgpu::Limits {
                max_storage_buffer_binding_size: bytes,
                max_buffer_size: bytes,
                ..downlevel(&adapter.limits())
            },
        };
        let features = adapter.features() & wgpu::Features::TIMESTAMP_QUERY;
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("litetex"),
            required_features: features,
            required_limits: required_limits.clone(),
            ..wgpu::DeviceDescriptor::default()
        });
        let (device, queue) = pollster::block_on(request)
            .map_err(|e| Error::Device(format!("{}: cannot be opened: {e}", choice.name)))?;
        let fault = SharedErrors::default();
        let on_error = fault.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            note(&on_error, |faults| &mut faults.refused, error.to_string());
        }));
        let on_lost = fault.clone();
        device.set_device_lost_callback(move |reason, message| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                note(&on_lost, |faults| &mut faults.lost, format!("the device was lost: {message}"));
            }
        });
        Ok(Self {
            choice: choice.clone(),
            device,
            queue,
            limits: required_limits,
            fault,
            work: WorkCounters::default(),
        })
    }

    /// What has been asked of it since it was opened.
    pub fn work(&self) -> DeviceWork {
        let [dispatches, submissions, waits] =
            [&self.work.dispatches, &self.work.submissions, &self.work.waits]
                .map(|n| n.load(Ordering::Relaxed));
        DeviceWork { dispatches, submissions, waits }
    }

    /// Counts a dispatch that is being encoded.
    pub(super) fn count_dispatch(&self) {
        self.work.dispatches.fetch_add(1, Ordering::Relaxed);
    }

    /// Submits what was encoded.
    pub(super) fn submit(&self, encoder: wgpu::CommandEncoder) {
        self.work.submissions.fetch_add(1, Ordering::Relaxed);
        self.queue.submit([encoder.finish()]);
    }

    /// Fails with the first thing that went wrong outside of any call, for good: who computes on must not
    /// build on what may not have been done.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(super) fn check(&self) -> Result<()> {
        let DriverErrors { lost, refused } = self.faults();
        lost.or(refused).map_or(Ok(()), |what| Err(self.error(&what)))
    }

    /// Fails only if the device is gone. A submission that was refused changed nothing: what was on the device
    /// before is there and whole.
    ///
    /// # Errors
    /// [`Error::Device`].
    fn check_alive(&self) -> Result<()> {
        self.faults().lost.map_or(Ok(()), |what| Err(self.error(&what)))
    }

    fn faults(&self) -> DriverErrors {
        self.fault.lock().map_or_else(|e| e.into_inner().clone(), |f| f.clone())
    }

    /// Destroys the device and notes it as lost.
    pub(super) fn lose(&self) {
        note(&self.fault, |faults| &mut faults.lost, "the device was lost: destroyed".into());
        self.device.destroy();
    }

    /// An error that names the device.
    pub(super) fn error(&self, what: &str) -> Error {
        Error::Device(format!("{}: {what}", self.choice.name))
    }

    /// A storage buffer of zeros for `count` elements of `element_bytes`.
    ///
    /// # Errors
    /// [`Error::Device`] with counts if it exceeds a limit, or if the memory is not to be had.
    pub(super) fn buffer(&self, what: &str, count: u64, element_bytes: u64) -> Result<wgpu::Buffer> {
        // Room for one element at least: an empty binding is refused.
        let bytes = (count.max(1) * element_bytes).next_multiple_of(16);
        let most = self.most_buffer_bytes();
        if bytes > most {
            return Err(self.error(&format!(
                "{what}: {count} x {element_bytes} bytes = {:.1} MiB, but a buffer may have {:.1} MiB here; use \
                 fewer splats, smaller maps or smaller images, or the device \"cpu\"",
                mib(bytes),
                mib(most)
            )));
        }
        self.allocate(&wgpu::BufferDescriptor {
            label: Some(what),
            size: bytes,
            usage: wgpu::BufferUsages::STORAGE
                | wgpu::BufferUsages::COPY_SRC
                | wgpu::BufferUsages::COPY_DST
                | wgpu::BufferUsages::INDIRECT,
            mapped_at_creation: false,
        })
    }

    /// A buffer of any usage.
    ///
    /// # Errors
    /// [`Error::Device`] if the memory is not to be had.
    pub(super) fn allocate(&self, descriptor: &wgpu::BufferDescriptor<'_>) -> Result<wgpu::Buffer> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let buffer = self.device.create_buffer(descriptor);
        let refused = [pollster::block_on(validation.pop()), pollster::block_on(memory.pop())];
        match refused.into_iter().flatten().next() {
            Some(error) => Err(self.error(&format!(
                "{} of {:.1} MiB was refused: {error}",
                descriptor.label.unwrap_or("a buffer"),
                mib(descriptor.size)
            ))),
            None => Ok(buffer),
        }
    }

    /// A uniform buffer with `count` entries at dynamic offsets.
    ///
    /// # Errors
    /// As [`GpuDevice::allocate`].
    pub(super) fn uniforms(&self, what: &str, count: u64) -> Result<wgpu::Buffer> {
        self.allocate(&wgpu::BufferDescriptor {
            label: Some(what),
            size: count * UNIFORM_STRIDE,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// Compiles kernels, with flags for the preprocessor on top of their own.
    ///
    /// # Errors
    /// [`Error::Device`] with the place in the shader if the driver does not take it.
    pub(super) fn pipelines(&self, ids: &[KernelId], flags: &[&str]) -> Result<BTreeMap<KernelId, Pipeline>> {
        let mut out = BTreeMap::new();
        for (id, kernel) in KERNELS.iter().filter(|(id, _)| ids.contains(id)) {
            out.insert(*id, self.pipeline(kernel, flags)?);
        }
        Ok(out)
    }

    fn pipeline(&self, kernel: &Kernel, flags: &[&str]) -> Result<Pipeline> {
        let flags = [kernel.flags, flags].concat();
        let expanded = expand(kernel.name, &flags, Dialect::Native).map_err(|e| self.error(&e))?;
        let filters =
            [wgpu::ErrorFilter::OutOfMemory, wgpu::ErrorFilter::Internal, wgpu::ErrorFilter::Validation];
        let scopes = filters.map(|filter| self.device.push_error_scope(filter));
        let module = self.module(kernel.name, &expanded.text);
        let layout = self.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(kernel.name),
            entries: &layout_entries(kernel),
        });
        let pipeline_layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(kernel.name),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(kernel.name),
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(kernel.name),
            compilation_options: wgpu::PipelineCompilationOptions {
                // The kernels initialise what they read.
                zero_initialize_workgroup_memory: false,
                ..wgpu::PipelineCompilationOptions::default()
            },
            cache: None,
        });
        // Scopes end in the reverse order of their beginnings.
        let refused = scopes.into_iter().rev().filter_map(|scope| pollster::block_on(scope.pop())).next();
        match refused {
            Some(error) => Err(self.error(&format!("shader {} was refused: {error}", kernel.name))),
            None => Ok(Pipeline { pipeline, layout }),
        }
    }

    /// A shader module without the loop counters and division guards that wgpu adds for untrusted code.
    #[allow(unsafe_code, reason = "the only way to ask for it")]
    fn module(&self, name: &str, text: &str) -> wgpu::ShaderModule {
        let descriptor =
            wgpu::ShaderModuleDescriptor { label: Some(name), source: wgpu::ShaderSource::Wgsl(text.into()) };
        let checks = wgpu::ShaderRuntimeChecks {
            bounds_checks: true,
            force_loop_bounding: false,
            int_div_checks: false,
            ..wgpu::ShaderRuntimeChecks::checked()
        };
        // SAFETY: the shaders are ours. Every loop counts up to a bound or down to zero and every divisor is
        // positive, by reading: no test proves it. Indices are still checked against their buffers.
        unsafe { self.device.create_shader_module_trusted(descriptor, checks) }
    }

    /// Waits for everything submitted and reads the first `count` elements of a buffer.
    ///
    /// # Errors
    /// [`Error::Device`] if the device is gone, or if something that was asked of it has not been done.
    pub(super) fn read<T: bytemuck::Pod>(&self, buffer: &wgpu::Buffer, count: usize) -> Result<Vec<T>> {
        let values = self.rescue(buffer, count);
        self.check()?;
        values
    }

    /// As [`GpuDevice::read`], also where something was refused before: for what a refusal leaves whole.
    ///
    /// # Errors
    /// [`Error::Device`] if the device is gone.
    pub(super) fn rescue<T: bytemuck::Pod>(&self, buffer: &wgpu::Buffer, count: usize) -> Result<Vec<T>> {
        let bytes = (count * size_of::<T>()) as u64;
        if bytes == 0 {
            return self.check_alive().map(|()| Vec::new());
        }
        let staging = self.staging("read-back", bytes)?;
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, bytes);
        self.submit(encoder);
        self.staged(&staging, count)
    }

    /// A buffer that is copied to on the device and read here.
    ///
    /// # Errors
    /// As [`GpuDevice::allocate`].
    pub(super) fn staging(&self, what: &str, bytes: u64) -> Result<wgpu::Buffer> {
        self.allocate(&wgpu::BufferDescriptor {
            label: Some(what),
            size: bytes.next_multiple_of(4),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// Waits until a staging buffer has been written and reads it.
    ///
    /// # Errors
    /// As [`GpuDevice::read`].
    pub(super) fn read_staged<T: bytemuck::Pod>(
        &self,
        staging: &wgpu::Buffer,
        count: usize,
    ) -> Result<Vec<T>> {
        let values = self.staged(staging, count);
        self.check()?;
        values
    }

    fn staged<T: bytemuck::Pod>(&self, staging: &wgpu::Buffer, count: usize) -> Result<Vec<T>> {
        let bytes = (count * size_of::<T>()) as u64;
        let (sender, receiver) = std::sync::mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, 0..bytes, move |outcome| {
            // The receiver is gone only if polling failed, which is reported below.
            let _ = sender.send(outcome);
        });
        self.work.waits.fetch_add(1, Ordering::Relaxed);
        self.device
            .poll(wgpu::PollType::wait_indefinitely())
            .map_err(|e| self.error(&format!("waiting for it failed: {e}")))?;
        self.check_alive()?;
        match receiver.try_recv() {
            Ok(Ok(())) => {}
            Ok(Err(e)) => return Err(self.error(&format!("reading back failed: {e}"))),
            Err(_) => return Err(self.error("reading back failed: no answer")),
        }
        let view = staging
            .get_mapped_range(0..bytes)
            .map_err(|e| self.error(&format!("reading back failed: {e}")))?;
        let values = bytemuck::pod_collect_to_vec(&view);
        drop(view);
        staging.unmap();
        Ok(values)
    }
}

fn note(fault: &SharedErrors, kind: fn(&mut DriverErrors) -> &mut Option<String>, message: String) {
    if let Ok(mut faults) = fault.lock() {
        kind(&mut faults).get_or_insert(message);
    }
}

fn mib(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

/// The floor of WebGPU, in everything that the kernels use.
fn downlevel(adapter: &wgpu::Limits) -> wgpu::Limits {
    wgpu::Limits {
        max_storage_buffers_per_shader_stage: 8,
        max_compute_workgroup_storage_size: 16 << 10,
        max_compute_invocations_per_workgroup: 256,
        max_storage_buffer_binding_size: 128 << 20,
        max_buffer_size: 256 << 20,
        ..wgpu::Limits::downlevel_defaults().or_worse_values_from(adapter)
    }
}

fn layout_entries(kernel: &Kernel) -> Vec<wgpu::BindGroupLayoutEntry> {
    let entry =
        |binding: u32, ty: wgpu::BufferBindingType, dynamic_bytes: Option<u64>| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty,
                has_dynamic_offset: dynamic_bytes.is_some(),
                min_binding_size: dynamic_bytes.and_then(wgpu::BufferSize::new),
            },
            count: None,
        };
    let uniform = wgpu::BufferBindingType::Uniform;
    let mut entries = vec![entry(0, uniform, Some(size_of::<StepUniform>() as u64))];
    for (binding, Binding { writes, .. }) in (1..).zip(kernel.bindings) {
        entries.push(entry(binding, wgpu::BufferBindingType::Storage { read_only: !writes }, None));
    }
    if kernel.has_sort_pass() {
        entries.push(entry(SORT_PASS_BINDING, uniform, Some(size_of::<SortPass>() as u64)));
    }
    entries
}
