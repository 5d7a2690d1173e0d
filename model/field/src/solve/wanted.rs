//! What a solution is requested for.

/// A printed figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Figure {
    /// [`crate::figures::Figures::centre_t`].
    Centre,
    /// [`crate::figures::Figures::core_mean_t`].
    CoreMean,
    /// Homogeneity over the whole core.
    CvWhole,
    /// Homogeneity within three quarters of the core's radius.
    CvThreeQuarters,
    /// Homogeneity within half of the core's radius.
    CvHalf,
    /// [`crate::figures::Figures::axial_pp`].
    AxialPp,
    /// [`crate::figures::Figures::radial_pp`].
    RadialPp,
    /// [`crate::figures::Figures::linkage_wb`].
    Linkage,
    /// [`crate::figures::Figures::force_n`].
    Force,
    /// [`crate::figures::Figures::plate_max_t`].
    PlateMax,
}

/// Figures that a solution has to have to the requested accuracy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted<'f> {
    /// Centre and core mean with the requested accuracy, flux linkage and force with errors 20 times as
    /// large, the greatest field in the plates within a fifth, and the other figures without a limit.
    Figures,
    /// These figures alone. Their limits are those of [`Wanted::Figures`]; the absolute error of a
    /// homogeneity is at most 20 times the requested accuracy, that of a peak-to-peak value at most
    /// 100 times.
    Only(&'f [Figure]),
}

impl Wanted<'_> {
    /// Whether a figure is wanted.
    pub(crate) fn has(&self, figure: Figure) -> bool {
        match self {
            Self::Figures => true,
            Self::Only(figures) => figures.contains(&figure),
        }
    }
}
