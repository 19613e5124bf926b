//! Growth by need: it ends where more parameters no longer lower the training error of the whole model (method 6.14).

/// Windows in a row that must find that growth does not pay before it ends.
const IDLE_WINDOWS: u32 = 2;

/// What `need_db` is asked of: a tenth more parameters.
const PARAMS_FACTOR: f64 = 1.1;

/// How growth has paid so far; part of a run's state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Growth {
    /// Mean loss of the training views and parameters of the model at the end of the window before; `None` before the first
    /// at full image size.
    pub before: Option<(f64, usize)>,
    /// Windows in a row in which growth did not pay.
    pub idle_windows: u32,
    /// Step after which growth ended; 0: it has not.
    pub ended_step: u32,
}

impl Growth {
    /// Whether growth has ended.
    pub fn has_ended(&self) -> bool {
        self.ended_step > 0
    }

    /// Takes in the mean loss of the training views at full image size, after a window in which the model had `params`
    /// parameters. Windows in which it did not grow tell nothing.
    pub fn observe(&mut self, loss: f64, params: usize, need_db: f64, step: u32) {
        if let Some((loss_before, params_before)) = self.before.replace((loss, params))
            && params > params_before
            && !self.has_ended()
        {
            // The loss is mostly an absolute error: its square makes the PSNR.
            let gained_db = 20.0 * (loss_before / loss).log10();
            let tenths = (params as f64 / params_before as f64).ln() / PARAMS_FACTOR.ln();
            self.idle_windows = if gained_db < need_db * tenths { self.idle_windows + 1 } else { 0 };
            if self.idle_windows >= IDLE_WINDOWS {
                self.ended_step = step;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_ends_after_two_windows_in_which_it_did_not_pay() {
        let ended = |windows: &[(f64, usize)]| {
            let mut growth = Growth::default();
            (1..).zip(windows).for_each(|(step, &(loss, params))| growth.observe(loss, params, 0.1, step));
            growth.ended_step
        };
        // A loss that falls to 0.99 is 0.087 dB, to 0.98 0.175 dB.
        assert_eq!(ended(&[(1.0, 1000), (0.99, 1100), (0.9801, 1210), (0.5, 1331)]), 3);
        assert_eq!(ended(&[(1.0, 1000), (0.98, 1100), (0.9604, 1210)]), 0);
        // The same gain for a twentieth more parameters pays.
        assert_eq!(ended(&[(1.0, 1000), (0.99, 1050), (0.9801, 1100)]), 0);
        // One window that paid between two that did not; windows without growth count for neither.
        assert_eq!(ended(&[(1.0, 1000), (1.0, 1100), (0.9, 1210), (0.9, 1331)]), 0);
        assert_eq!(ended(&[(1.0, 1000), (1.0, 1100), (0.9, 1100), (0.9, 1210)]), 4);
    }
}
