//! What changes of a splat cost where all that is known of them is what probes tell.

/// What changes of a splat cost, mean squared changes of the images.
#[derive(Clone, Copy, Debug, Default)]
pub struct SplatCosts {
    /// Of its removal.
    pub removal: f64,
    /// Of a change of its colour by 1 in all channels.
    pub colour: f64,
}
