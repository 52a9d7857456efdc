//! The contact solver sees the problem's matrix through [`Delassus`]: the matrix S = G W G^T with the contacts' own
//! compliance on its diagonal: [`Dense`] has it in full, [`Sparse`] never puts it together.
//!
//! [`Dense`]: crate::row::dense::Dense
//! [`Sparse`]: crate::row::sparse::Sparse

/// The state of a friction force in the working set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Friction {
    /// Its disc is a point.
    None,
    Inside,
    /// On the rim in direction (y, z); stiffness against turning along it.
    Rim(f64, f64, f64),
}

/// The working set of the active-set method: which contacts press, and what their friction does.
#[derive(Debug, Default)]
pub(crate) struct WorkingSet {
    pub pressed: Vec<bool>,
    pub friction: Vec<Friction>,
}

/// The matrix S, symmetric positive definite, in three components a contact (normal, two tangential).
pub(crate) trait Delassus {
    /// `out += S l`.
    fn add_product(&mut self, l: &[f64], out: &mut [f64]);

    fn diagonal(&self, i: usize) -> f64;

    /// The larger tangential compliance of the contact whose components start at `i`.
    fn tangential(&self, i: usize) -> f64 {
        self.diagonal(i + 1).max(self.diagonal(i + 2))
    }

    /// Contacts that enter the working set together: none yet.
    fn none_entered(&mut self);

    /// Says whether a contact may enter with those that have, since it does not depend on them, and counts it as one of
    /// them then.
    fn enters(&mut self, c: usize) -> bool;

    /// Minimizes over the working set without bounds, from a point with this gradient: the change of the forces. Rims
    /// may stand a little otherwise where the factorization is of what they were (`stale`, in rad). False when the
    /// matrix of the set is not positive definite.
    fn solve_set(&mut self, set: &WorkingSet, gradient: &[f64], stale: f64, change: &mut [f64]) -> bool;

    /// Solves the working set with the friction on every rim following the normal force by `mu`: the forces. False when
    /// there is no solution.
    fn solve_following(&mut self, set: &WorkingSet, b: &[f64], mu: &[f64], forces: &mut [f64]) -> bool;

    /// Multiplications since last asked, about.
    fn spent(&mut self) -> f64;
}
