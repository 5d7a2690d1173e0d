//! Statistics of many ramps.

/// Errors of many estimates, each divided by a reference standard error.
#[derive(Clone, Debug, Default)]
pub struct EstimateErrors {
    pub count: usize,
    sum: f64,
    squares: f64,
    pub covered: usize,
    pub refused: usize,
}

impl EstimateErrors {
    pub fn add(&mut self, error: f64, covered: bool) {
        self.count += 1;
        self.sum += error;
        self.squares += error * error;
        self.covered += usize::from(covered);
    }

    pub fn mean(&self) -> f64 {
        self.sum / self.count as f64
    }

    pub fn rms(&self) -> f64 {
        (self.squares / self.count as f64).sqrt()
    }

    pub fn coverage(&self) -> f64 {
        self.covered as f64 / self.count as f64
    }
}
