//! Brakes of reels: the last element of a thread carries no more than a given tension; what would stretch it more comes
//! off the reel. Within a substep it is perfectly plastic, with tension K C3 up to the limit and the limit beyond;
//! afterwards its rest length takes the excess.

use crate::math::outer;
use crate::model::Model;
use crate::model::reel::ReelLaw;
use crate::rod::element_strain;
use crate::rod::scratch::RodScratch;
use crate::state::State;
use glam::DVec3;

/// Part of the limit by which the tension may be off where the brake is taken to hold, or to slip.
const OFF: f64 = 1e-3;

/// A brake in the substep.
pub(crate) struct Brake {
    pub reel: u32,
    pub element: usize,
    /// Tension at which it slips \[N\].
    pub limit: f64,
    pub slips: bool,
}

impl Brake {
    /// Tension of its element if nothing came off the reel.
    fn trial(&self, model: &Model, state: &State) -> f64 {
        element_strain(model, state, self.element).z * model.stretch_stiffness[self.element].z
    }
    /// Length that came off in the substep \[m\].
    pub fn paid(&self, model: &Model, state: &State) -> f64 {
        let (e, l) = (self.element, model.rest_length[self.element]);
        // Stretched by limit / EA it is as long as it is now.
        let at_limit =
            (l + element_strain(model, state, e).z) / (1.0 + self.limit / (model.stretch_stiffness[e].z * l));
        if self.slips { (at_limit - l).max(0.0) } else { 0.0 }
    }
}

/// Lists the brakes of the substep.
pub(crate) fn begin(model: &Model, state: &State, brakes: &mut Vec<Brake>) {
    brakes.clear();
    for (slot, reel) in state.reels.iter() {
        if let ReelLaw::Brake(limit) = reel.law
            && reel.supply != Some(0.0)
        {
            brakes.push(Brake { reel: slot, element: reel.element(model), limit, slips: false });
        }
    }
}

/// Decides which slip in this iteration.
pub(crate) fn review(model: &Model, state: &State, brakes: &mut [Brake]) {
    for b in brakes {
        b.slips = b.trial(model, state) > b.limit;
    }
}

/// Whether the tensions at the iterate agree with what was decided.
pub(crate) fn settled(model: &Model, state: &State, brakes: &[Brake]) -> bool {
    brakes.iter().all(|b| {
        let over = b.trial(model, state) / b.limit - 1.0;
        if b.slips { over > -OFF } else { over < OFF }
    })
}

/// Takes the axial stiffness of what slips out of the assembled system and makes its tension the limit. With C3 = t .
/// (x1 - x0) - l and n = t x d, its derivative is -t, n, t on x0, the frame and x1.
pub(crate) fn assemble(model: &Model, state: &State, rods: &mut RodScratch) {
    let RodScratch { brakes, system, rhs, .. } = rods;
    for b in brakes.iter().filter(|b| b.slips) {
        let e = b.element;
        let t = state.orientation[e] * DVec3::Z;
        let n = t.cross(state.position[e + 1] - state.position[e]);
        let k = model.stretch_stiffness[e].z;
        let over = b.trial(model, state) - b.limit;
        rhs[2 * e] -= t * over;
        rhs[2 * e + 1] += n * over;
        rhs[2 * e + 2] += t * over;
        let (tt, tn) = (outer(t, t) * k, outer(t, n) * k);
        system.diagonal[2 * e] -= tt;
        system.diagonal[2 * e + 1] -= outer(n, n) * k;
        system.diagonal[2 * e + 2] -= tt;
        system.next[2 * e] += tn;
        system.next[2 * e + 1] -= tn.transpose();
        system.after[2 * e] += tt;
    }
}
