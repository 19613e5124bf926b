//! An open device: allocates buffers within its limits, compiles pipelines, waits and reads back. All driver
//! failures become typed errors here.

use super::adapter::AdapterChoice;
use super::kernels::{Binding, KERNELS, Kernel, KernelId, SORT_PASS_BINDING};
use super::layout::{SortPass, StepUniform};
use super::shader::expand;
use crate::{Error, NoRoom, Result};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// Limits to request when a device is opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LimitChoice {
    /// All that the adapter offers.
    Adapter,
    /// The minimum that WebGPU guarantees: 8 storage buffers, 16 KiB of workgroup memory, bindings of 128 MiB.
    Downlevel,
    /// As `Downlevel`, with buffers of at most this many bytes: for tests with scenes that do not fit.
    Buffers(u64),
}

/// A compiled kernel.
pub(super) struct Pipeline {
    pub pipeline: wgpu::ComputePipeline,
    pub layout: wgpu::BindGroupLayout,
}

/// Errors that the driver reported asynchronously, the first of each kind.
#[derive(Clone, Debug, Default)]
struct DriverErrors {
    /// Why the device was lost.
    lost: Option<String>,
    /// The first uncaptured error: some command was not carried out.
    refused: Option<String>,
}

type SharedErrors = Arc<Mutex<DriverErrors>>;

/// Work that a device was given, counted when it is encoded or submitted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DeviceWork {
    /// Number of dispatches.
    pub dispatches: u64,
    /// Number of submissions of command buffers, including copies to staging buffers.
    pub submissions: u64,
    /// Submissions of steps made before the statuses of the one before were read.
    pub overlapping: u64,
    /// How often the host waited for the device.
    pub waits: u64,
    /// Models sent to the device, with the optimiser's state.
    pub uploads: u64,
    /// Photos sent to the device.
    pub photos: u64,
    /// Bytes read back.
    pub read_bytes: u64,
}

/// Counters behind [`DeviceWork`].
#[derive(Default)]
pub(super) struct WorkCounters {
    dispatches: AtomicU64,
    submissions: AtomicU64,
    pub(super) overlapping: AtomicU64,
    pub(super) waits: AtomicU64,
    pub(super) uploads: AtomicU64,
    pub(super) photos: AtomicU64,
    read_bytes: AtomicU64,
}

impl WorkCounters {
    fn so_far(&self) -> DeviceWork {
        let of = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        DeviceWork {
            dispatches: of(&self.dispatches),
            submissions: of(&self.submissions),
            overlapping: of(&self.overlapping),
            waits: of(&self.waits),
            uploads: of(&self.uploads),
            photos: of(&self.photos),
            read_bytes: of(&self.read_bytes),
        }
    }
}

/// An open device.
pub struct GpuDevice {
    /// Name and description.
    pub choice: AdapterChoice,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) limits: wgpu::Limits,
    subgroup_lanes: u32,
    errors: SharedErrors,
    work: Arc<WorkCounters>,
}

/// What a run without room for a buffer may try.
const LESS: &str = "use fewer splats, smaller maps or smaller images, or the device \"cpu\"";

/// Bytes between entries that are bound at dynamic offsets: a multiple of 256, the largest alignment that a
/// device may require.
pub(super) const UNIFORM_STRIDE: u64 = 512;
const _: () = assert!(size_of::<StepUniform>() as u64 <= UNIFORM_STRIDE, "entries of the ring would overlap");

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
        let info = adapter.get_info();
        let sizes = [info.subgroup_min_size, info.subgroup_max_size];
        let mut wanted = wgpu::Features::TIMESTAMP_QUERY;
        wanted.set(wgpu::Features::SUBGROUP, sizes[0] == sizes[1]);
        let features = adapter.features() & wanted;
        let subgroup_lanes = if features.contains(wgpu::Features::SUBGROUP) { sizes[0] } else { 0 };
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("litetex"),
            required_features: features,
            required_limits: required_limits.clone(),
            ..wgpu::DeviceDescriptor::default()
        });
        let (device, queue) = pollster::block_on(request)
            .map_err(|e| Error::Device(format!("{}: cannot be opened: {e}", choice.name)))?;
        let errors = SharedErrors::default();
        let on_error = errors.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            record_first(&on_error, |errors| &mut errors.refused, error.to_string());
        }));
        let on_lost = errors.clone();
        device.set_device_lost_callback(move |reason, message| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                record_first(&on_lost, |errors| &mut errors.lost, format!("the device was lost: {message}"));
            }
        });
        Ok(Self {
            choice: choice.clone(),
            device,
            queue,
            limits: required_limits,
            subgroup_lanes,
            errors,
            work: Arc::default(),
        })
    }

    /// A number that no other open device has.
    pub(super) fn id(&self) -> usize {
        Arc::as_ptr(&self.work) as usize
    }

    /// Lanes of every subgroup; 0 where the size varies, or without subgroups.
    pub fn subgroup_lanes(&self) -> u32 {
        self.subgroup_lanes
    }

    /// Work that it was given since it was opened.
    pub fn work(&self) -> DeviceWork {
        self.work.so_far()
    }

    /// As [`Self::work`], also while something else holds the device.
    pub fn work_meter(&self) -> impl Fn() -> DeviceWork + use<> {
        let work = Arc::clone(&self.work);
        move || work.so_far()
    }

    pub(super) fn count_dispatch(&self) {
        self.count(|work| &work.dispatches);
    }

    /// Adds one to a counter.
    pub(super) fn count(&self, counter: fn(&WorkCounters) -> &AtomicU64) {
        counter(&self.work).fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn count_read(&self, bytes: u64) {
        self.work.read_bytes.fetch_add(bytes, Ordering::Relaxed);
    }

    pub(super) fn submit(&self, encoder: wgpu::CommandEncoder) -> wgpu::SubmissionIndex {
        self.count(|work| &work.submissions);
        self.queue.submit([encoder.finish()])
    }

    /// Copies buffers to others that are at least as large.
    pub(super) fn copy_all<'b>(&self, pairs: impl Iterator<Item = (&'b wgpu::Buffer, &'b wgpu::Buffer)>) {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        pairs.for_each(|(from, to)| encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size()));
        self.submit(encoder);
    }

    /// Fails, from the first asynchronous error on: later steps must not build on commands that may not have been
    /// carried out.
    ///
    /// # Errors
    /// [`Error::Device`] with the first error that the driver reported.
    pub(super) fn check(&self) -> Result<()> {
        let DriverErrors { lost, refused } = self.driver_errors();
        lost.or(refused).map_or(Ok(()), |what| Err(self.error(&what)))
    }

    /// Fails only if the device was lost. A refused submission changed nothing: the earlier contents of the device
    /// are intact.
    ///
    /// # Errors
    /// [`Error::Device`] with the driver's reason.
    pub(super) fn check_alive(&self) -> Result<()> {
        self.driver_errors().lost.map_or(Ok(()), |what| Err(self.error(&what)))
    }

    fn driver_errors(&self) -> DriverErrors {
        self.errors.lock().map_or_else(|e| e.into_inner().clone(), |errors| errors.clone())
    }

    /// Destroys the device and records it as lost.
    pub(super) fn lose(&self) {
        record_first(&self.errors, |errors| &mut errors.lost, "the device was lost: destroyed".into());
        self.device.destroy();
    }

    /// An error that names the device.
    pub(super) fn error(&self, what: &str) -> Error {
        Error::Device(format!("{}: {what}", self.choice.name))
    }

    /// The error that the device has no room.
    pub(super) fn full(&self, what: &str, remedy: Option<&'static str>) -> Error {
        Error::DeviceFull(NoRoom { what: format!("{}: {what}", self.choice.name), remedy })
    }

    /// A storage buffer of zeros for `count` elements of `element_bytes`.
    ///
    /// # Errors
    /// [`Error::DeviceFull`], with the sizes, if the buffer exceeds a limit or memory fails.
    pub(super) fn buffer(&self, what: &str, count: u64, element_bytes: u64) -> Result<wgpu::Buffer> {
        // Room for at least one element: empty bindings are invalid.
        let bytes = (count.max(1) * element_bytes).next_multiple_of(16);
        let most = self.most_buffer_bytes();
        if bytes > most {
            let needed = format!(
                "{what}: {count} x {element_bytes} bytes = {:.1} MiB, but buffers are limited to {:.1} MiB",
                mib(bytes),
                mib(most)
            );
            return Err(self.full(&needed, Some(LESS)));
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
    /// [`Error::DeviceFull`] if memory fails, [`Error::Device`] if the driver refuses the buffer for another reason.
    pub(super) fn allocate(&self, descriptor: &wgpu::BufferDescriptor<'_>) -> Result<wgpu::Buffer> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let buffer = self.device.create_buffer(descriptor);
        let (invalid, memory) = (pollster::block_on(validation.pop()), pollster::block_on(memory.pop()));
        let message = |error: &wgpu::Error| {
            let what = descriptor.label.unwrap_or("a buffer");
            format!("cannot allocate {what} of {:.1} MiB: {error}", mib(descriptor.size))
        };
        match (invalid, memory) {
            (Some(error), _) => Err(self.error(&message(&error))),
            // A lost device has no memory either.
            (None, Some(error)) => {
                self.check_alive().and_then(|()| Err(self.full(&message(&error), Some(LESS))))
            }
            (None, None) => Ok(buffer),
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

    /// Compiles kernels, with preprocessor flags in addition to their own; with `checks_indices`, indices of arrays and
    /// buffers are clamped.
    ///
    /// # Errors
    /// [`Error::Device`] with the driver's message if it rejects a shader.
    pub(super) fn pipelines(
        &self,
        ids: &[KernelId],
        flags: &[&str],
        checks_indices: bool,
    ) -> Result<BTreeMap<KernelId, Pipeline>> {
        let mut out = BTreeMap::new();
        for (id, kernel) in KERNELS.iter().filter(|(id, _)| ids.contains(id)) {
            out.insert(*id, self.pipeline(kernel, flags, checks_indices)?);
        }
        Ok(out)
    }

    fn pipeline(&self, kernel: &Kernel, flags: &[&str], checks_indices: bool) -> Result<Pipeline> {
        let flags = [kernel.flags, flags].concat();
        let expanded = expand(kernel.name, &flags).map_err(|e| self.error(&e))?;
        let filters =
            [wgpu::ErrorFilter::OutOfMemory, wgpu::ErrorFilter::Internal, wgpu::ErrorFilter::Validation];
        let scopes = filters.map(|filter| self.device.push_error_scope(filter));
        let module = self.module(kernel.name, &expanded.text, checks_indices);
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
                // The kernels initialise all workgroup memory that they read.
                zero_initialize_workgroup_memory: false,
                ..wgpu::PipelineCompilationOptions::default()
            },
            cache: None,
        });
        // Error scopes form a stack: all are popped, whatever they hold.
        let refused: Vec<_> =
            scopes.into_iter().rev().filter_map(|scope| pollster::block_on(scope.pop())).collect();
        match refused.into_iter().next() {
            Some(error) => Err(self.error(&format!("the driver rejected shader {}: {error}", kernel.name))),
            None => Ok(Pipeline { pipeline, layout }),
        }
    }

    /// A shader module without the loop counters and division guards that wgpu adds for untrusted code.
    #[allow(unsafe_code, reason = "wgpu offers no safe way to leave them out")]
    fn module(&self, name: &str, text: &str, checks_indices: bool) -> wgpu::ShaderModule {
        let descriptor =
            wgpu::ShaderModuleDescriptor { label: Some(name), source: wgpu::ShaderSource::Wgsl(text.into()) };
        let checks = wgpu::ShaderRuntimeChecks {
            bounds_checks: checks_indices,
            force_loop_bounding: false,
            int_div_checks: false,
            ..wgpu::ShaderRuntimeChecks::checked()
        };
        // SAFETY: the shaders are our own. By inspection, not by test: every loop counts up to a bound or down to
        // zero, and every divisor is positive. Indices of buffers that are not checked here are checked by the device
        // (`AdapterChoice::bounds_buffers`). Indices of workgroup and local arrays are the invocation's number, or loop counters,
        // digits and columns bounded by the length; twins test the kernels both ways.
        unsafe { self.device.create_shader_module_trusted(descriptor, checks) }
    }
}

/// Keeps the message unless there is an earlier error of the same kind.
fn record_first(errors: &SharedErrors, kind: fn(&mut DriverErrors) -> &mut Option<String>, message: String) {
    if let Ok(mut errors) = errors.lock() {
        kind(&mut errors).get_or_insert(message);
    }
}

fn mib(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

/// The minimum limits of WebGPU, for all that the kernels use.
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
