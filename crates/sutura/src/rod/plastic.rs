//! Plastic bending and twist.

use crate::model::Model;
use crate::rod::joint_angle;
use crate::state::State;
use glam::DVec3;

/// Bend and twist beyond yield become permanent (return mapping with isotropic hardening, bending radially in the two
/// directions).
pub(crate) fn yield_plastic(model: &Model, state: &mut State) {
    for (_, rod) in model.rods.iter() {
        let Some(p) = rod.material.plasticity else { continue };
        // Plastic modulus so that the slope after yield is `hardening` times the elastic one.
        let harden = p.hardening / (1.0 - p.hardening);
        for e in rod.elements().skip(1).filter(|e| model.weld_of[*e].is_none()) {
            let l = model.joint_length[e];
            let a = joint_angle(model, state, e);
            let grown = 1.0 + harden * state.hardened[e];
            let bend = (a.x * a.x + a.y * a.y).sqrt();
            let over = bend - p.yield_curvature * l * grown;
            if over > 0.0 {
                let flow = over / (1.0 + harden);
                state.plastic[e] += DVec3::new(a.x, a.y, 0.0) * (flow / bend);
                state.hardened[e] += flow / (p.yield_curvature * l);
            }
            let over = a.z.abs() - p.yield_twist * l * grown;
            if over > 0.0 {
                let flow = over / (1.0 + harden);
                state.plastic[e].z += flow * a.z.signum();
                state.hardened[e] += flow / (p.yield_twist * l);
            }
        }
    }
}
