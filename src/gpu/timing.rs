//! Times individual dispatches by the device's timestamps.

use super::device::GpuDevice;
use crate::Result;
use std::time::Duration;

const MAX_QUERIES: u32 = wgpu::QUERY_SET_MAX_QUERIES;

/// Two timestamps around each dispatch of a submission.
pub(super) struct Timer {
    pub queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    nanoseconds_per_tick: f64,
}

impl Timer {
    /// `None` on devices without timestamps.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if allocation fails.
    pub(super) fn new(device: &GpuDevice) -> Result<Option<Self>> {
        if !device.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return Ok(None);
        }
        let queries = device.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("dispatches"),
            ty: wgpu::QueryType::Timestamp,
            count: MAX_QUERIES,
        });
        let resolved = device.allocate(&wgpu::BufferDescriptor {
            label: Some("timestamps"),
            size: u64::from(MAX_QUERIES) * 8,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        })?;
        let nanoseconds_per_tick = f64::from(device.queue.get_timestamp_period());
        Ok(Some(Self { queries, resolved, nanoseconds_per_tick }))
    }

    /// Largest number of dispatches per submission that can be timed.
    pub(super) const MAX_DISPATCHES: usize = MAX_QUERIES as usize / 2;

    /// Encodes a copy of the timestamps of the first `dispatches` dispatches.
    pub(super) fn resolve(&self, encoder: &mut wgpu::CommandEncoder, dispatches: usize) {
        encoder.resolve_query_set(&self.queries, 0..2 * dispatches as u32, &self.resolved, 0);
    }

    /// Duration of each dispatch of the last submission.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if the device was lost.
    pub(super) fn read(&self, device: &GpuDevice, dispatches: usize) -> Result<Vec<Duration>> {
        let ticks: Vec<[u64; 2]> = device.read(&self.resolved, dispatches)?;
        let time = |[start, end]: &[u64; 2]| {
            Duration::from_nanos((end.saturating_sub(*start) as f64 * self.nanoseconds_per_tick) as u64)
        };
        Ok(ticks.iter().map(time).collect())
    }
}
