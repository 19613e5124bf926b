//! Probes, whose costs are summed on the device.

use super::encode::Dispatch;
use super::kernels::{Buf, KernelId};
use super::layout::FLAG_PERSIST;
use super::shape::Clock;
use super::state::GpuBackend;
use super::submission::Task;
use super::uniform;
use crate::Result;
use crate::backend::{Costs, Probe, StepRequest};

/// Kernels that only probes need.
const KERNELS: [KernelId; 2] = [KernelId::PrepareProbes, KernelId::ProbeCosts];

/// Floats of the costs of a splat, in the order of `shaders/probe_costs.wgsl`.
const COSTS: usize = 22;

/// Takes probes, as many at a time as steps in a submission: a probe has the size of a photo.
///
/// # Errors
/// Those of the probes, and of the device.
pub(super) fn probe(
    backend: &mut GpuBackend,
    probes: &mut dyn Iterator<Item = Result<Probe>>,
) -> Result<Vec<Costs>> {
    backend.check()?;
    prepare(backend)?;
    let n = backend.shape.num_splats();
    let costs = backend.device.buffer("costs of probes", (n * COSTS) as u64, 4)?;
    backend.resources.set(Buf::Costs, costs);
    let outcome = run(backend, probes, n);
    backend.resources.remove(Buf::Costs);
    outcome
}

fn run(
    backend: &mut GpuBackend,
    probes: &mut dyn Iterator<Item = Result<Probe>>,
    n: usize,
) -> Result<Vec<Costs>> {
    loop {
        let batch: Vec<Probe> = probes.take(backend.pace.steps()).collect::<Result<_>>()?;
        if batch.is_empty() {
            break;
        }
        let requests: Vec<StepRequest<'_>> = batch.iter().map(StepRequest::of_probe).collect();
        backend.run(Task::Probe, &requests)?;
    }
    let costs: Vec<[f32; COSTS]> = backend.device.read(backend.resources.buffer(Buf::Costs), n)?;
    Ok(costs.iter().map(unpacked).collect())
}

/// Replaces the model by the one that is probed, with moments of zero.
fn prepare(backend: &mut GpuBackend) -> Result<()> {
    backend.compile(KERNELS.to_vec())?;
    backend.flush_all();
    backend.arm();
    let uniform = uniform::without_view(&backend.uniform_inputs(), FLAG_PERSIST);
    let offsets = backend.set_uniform(0, &uniform);
    backend.submit(&[Dispatch::new(KernelId::PrepareProbes, offsets)]);
    let shape = backend.shape.clone();
    backend.adopt(shape, Clock::default());
    backend.device.check()
}

fn unpacked(floats: &[f32; COSTS]) -> Costs {
    let [seen, removal, colour, degree_0, degree_1, degree_2, map, both, rows, cols, crops @ ..] =
        floats.map(f64::from);
    let crop = |axis: usize, end: usize, depth: usize| crops[6 * axis + 3 * end + depth];
    let side = |axis: usize, end: usize| [0, 1, 2].map(|depth| crop(axis, end, depth));
    Costs {
        seen: seen as u32,
        removal,
        colour,
        degrees: [degree_0, degree_1, degree_2],
        map,
        coarser: [both, rows, cols],
        crops: [0, 1].map(|axis| [0, 1].map(|end| side(axis, end))),
    }
}
