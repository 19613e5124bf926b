//! What the parts of a model count for where it is pruned: their charge, and what their fragments cost on a screen.

/// Prices of all parts, whose sum is the charge of the model.
pub struct Prices {
    /// Price of a unit of the charge.
    of_charge: f64,
    /// Price of each splat's fragments; empty where they cost nothing. `[n]`
    of_fragments: Vec<f64>,
}

impl Prices {
    /// The charge alone.
    pub const NONE: Self = Self { of_charge: 1.0, of_fragments: Vec::new() };

    /// Prices of a model of this charge, whose splats have these rasterised fragments: all of them count together `price`
    /// times as much as the charge.
    pub fn new(price: f64, charge: f64, mut fragments: Vec<f64>) -> Self {
        let layers: f64 = fragments.iter().sum();
        if !(price > 0.0 && layers > 0.0) {
            return Self::NONE;
        }
        let of_charge = 1.0 / (1.0 + price);
        fragments.iter_mut().for_each(|of_splat| *of_splat *= of_charge * price * charge / layers);
        Self { of_charge, of_fragments: fragments }
    }

    /// Price of a part with this charge and without fragments of its own.
    pub fn of_charge(&self, charge: f64) -> f64 {
        self.of_charge * charge
    }

    /// Price of a whole splat.
    pub fn of_removal(&self, splat: usize, charge: f64) -> f64 {
        self.of_charge(charge) + self.of_fragments.get(splat).copied().unwrap_or(0.0)
    }
}
