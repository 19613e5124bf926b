//! Writes to buffers through memory of our own: when wgpu finds none for its own, the device is lost.

use super::device::GpuDevice;
use crate::Result;

/// Up to here wgpu finds memory, or nothing else would work either.
const SMALL_BYTES: usize = 64 << 10;
/// Large writes go in pieces.
const PIECE_BYTES: usize = 64 << 20;

impl GpuDevice {
    /// Writes a multiple of four bytes into a buffer.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFull`] if memory fails: a part may have been written.
    pub(super) fn write(&self, buffer: &wgpu::Buffer, at_bytes: u64, bytes: &[u8]) -> Result<()> {
        if bytes.len() <= SMALL_BYTES {
            self.queue.write_buffer(buffer, at_bytes, bytes);
            return Ok(());
        }
        for (piece, at_bytes) in bytes.chunks(PIECE_BYTES).zip((at_bytes..).step_by(PIECE_BYTES)) {
            let staging = self.filled_staging(piece)?;
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encoder.copy_buffer_to_buffer(&staging, 0, buffer, at_bytes, piece.len() as u64);
            self.submit(encoder);
        }
        Ok(())
    }

    /// Writes multiples of four bytes to the beginning of buffers: to all, or to none if memory fails.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFull`] if memory fails.
    pub(super) fn write_all<'a>(
        &self,
        writes: impl Iterator<Item = (&'a wgpu::Buffer, &'a [u8])>,
    ) -> Result<()> {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for (buffer, bytes) in writes {
            for (piece, at_bytes) in bytes.chunks(PIECE_BYTES).zip((0..).step_by(PIECE_BYTES)) {
                encoder.copy_buffer_to_buffer(
                    &self.filled_staging(piece)?,
                    0,
                    buffer,
                    at_bytes,
                    piece.len() as u64,
                );
            }
        }
        self.submit(encoder);
        Ok(())
    }

    /// A buffer to copy from that holds `bytes`.
    fn filled_staging(&self, bytes: &[u8]) -> Result<wgpu::Buffer> {
        let staging = self.allocate(&wgpu::BufferDescriptor {
            label: Some("memory for writing"),
            size: bytes.len() as u64,
            usage: wgpu::BufferUsages::MAP_WRITE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: true,
        })?;
        let mut mapped = staging.get_mapped_range_mut(..).map_err(|e| self.error(&e.to_string()))?;
        mapped.copy_from_slice(bytes);
        drop(mapped);
        staging.unmap();
        Ok(staging)
    }

    /// Sets a buffer to zeros.
    pub(super) fn clear(&self, buffer: &wgpu::Buffer) {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.clear_buffer(buffer, 0, None);
        self.submit(encoder);
    }
}
