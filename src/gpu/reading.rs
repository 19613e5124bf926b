//! Reads buffers back: copies to staging buffers, which are mapped once the device was waited for.

use super::device::GpuDevice;
use crate::Result;

impl GpuDevice {
    /// Waits for all submitted work and reads the first `count` elements of a buffer.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if the device was lost, or any command was not carried out.
    pub(super) fn read<T: bytemuck::Pod>(&self, buffer: &wgpu::Buffer, count: usize) -> Result<Vec<T>> {
        let values = self.rescue(buffer, count);
        self.check()?;
        values
    }

    /// As [`GpuDevice::read`], but also works after refused commands: for buffers that they leave intact.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if the device was lost.
    pub(super) fn rescue<T: bytemuck::Pod>(&self, buffer: &wgpu::Buffer, count: usize) -> Result<Vec<T>> {
        let bytes = (count * size_of::<T>()) as u64;
        if bytes == 0 {
            return self.check_alive().map(|()| Vec::new());
        }
        let staging = self.staging("read-back", bytes)?;
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, bytes);
        let index = self.submit(encoder);
        self.staged(&staging, count, index)
    }

    /// A buffer that the device copies to and the host reads.
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

    /// Waits for the submission that writes a staging buffer, not for later ones, and reads the buffer.
    ///
    /// # Errors
    /// As [`GpuDevice::read`].
    pub(super) fn read_staged<T: bytemuck::Pod>(
        &self,
        staging: &wgpu::Buffer,
        count: usize,
        written_by: wgpu::SubmissionIndex,
    ) -> Result<Vec<T>> {
        // The end of a refused submission never comes.
        self.check()?;
        let values = self.staged(staging, count, written_by);
        self.check()?;
        values
    }

    /// Reads the first bytes of several buffers with one wait, as floats; also after refused commands, as [`Self::rescue`].
    ///
    /// # Errors
    /// [`crate::Error::Device`] if the device was lost.
    pub(super) fn rescue_all(&self, buffers: &[(&wgpu::Buffer, u64)]) -> Result<Vec<Vec<f32>>> {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut stagings = Vec::new();
        for &(buffer, bytes) in buffers {
            // Empty ranges cannot be mapped.
            let Ok(staging) = self.staging("read-back", bytes.max(4)) else {
                // One after the other takes less memory.
                let one = |&(buffer, bytes): &(&wgpu::Buffer, u64)| self.rescue(buffer, bytes as usize / 4);
                return buffers.iter().map(one).collect();
            };
            encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, bytes);
            stagings.push((staging, bytes));
        }
        let index = self.submit(encoder);
        let outcomes: Vec<_> = stagings.iter().map(|(staging, bytes)| map(staging, *bytes)).collect();
        self.wait_for(index)?;
        outcomes
            .iter()
            .zip(&stagings)
            .map(|(outcome, (staging, bytes))| self.mapped(outcome, staging, *bytes))
            .collect()
    }

    fn staged<T: bytemuck::Pod>(
        &self,
        staging: &wgpu::Buffer,
        count: usize,
        written_by: wgpu::SubmissionIndex,
    ) -> Result<Vec<T>> {
        let bytes = (count * size_of::<T>()) as u64;
        let outcome = map(staging, bytes);
        self.wait_for(written_by)?;
        self.mapped(&outcome, staging, bytes)
    }

    /// Waits for a submission, and so for those before it.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if the device was lost, or the submission was refused.
    pub(super) fn wait_for(&self, submission: wgpu::SubmissionIndex) -> Result<()> {
        self.count(|work| &work.waits);
        let poll = wgpu::PollType::Wait { submission_index: Some(submission), timeout: None };
        let outcome = self.device.poll(poll);
        self.check_alive()?;
        outcome.map(drop).map_err(|e| self.error(&format!("waiting for the device failed: {e}")))
    }

    /// The contents of a staging buffer that [`map`] has mapped.
    fn mapped<T: bytemuck::Pod>(
        &self,
        outcome: &Mapping,
        staging: &wgpu::Buffer,
        bytes: u64,
    ) -> Result<Vec<T>> {
        if bytes == 0 {
            return Ok(Vec::new());
        }
        match outcome.try_recv() {
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
        self.count_read(bytes);
        Ok(values)
    }
}

/// Answers whether a buffer was mapped, once the device was waited for.
type Mapping = std::sync::mpsc::Receiver<std::result::Result<(), wgpu::BufferAsyncError>>;

/// Asks for the first bytes of a staging buffer.
fn map(staging: &wgpu::Buffer, bytes: u64) -> Mapping {
    let (sender, receiver) = std::sync::mpsc::channel();
    if bytes > 0 {
        staging.map_async(wgpu::MapMode::Read, 0..bytes, move |outcome| {
            // The receiver is dropped only if waiting failed, which is reported.
            let _ = sender.send(outcome);
        });
    }
    receiver
}
