//! Dead torques. A torque that keeps its direction in the world while its frame turns has no energy, so its Newton
//! matrix is not symmetric: at the loaded frame it is H - [tau]x / 2 (world increments, q <- exp(phi) q). The solver's
//! matrix is the symmetric H; this corrects its solution by the Woodbury identity, three columns a loaded frame.
//! Without it a tip moment beyond about 5 EI / L does not converge.

use crate::math::skew;
use crate::rod::factor::System;
use core::ops::Range;
use glam::DVec3;

/// Working memory: the loaded nodes, the columns of the inverse there, and the small dense system.
#[derive(Default)]
pub(crate) struct TorqueCorrection {
    nodes: Vec<usize>,
    columns: Vec<Vec<DVec3>>,
    dense: Vec<f64>,
    right: Vec<f64>,
}

impl TorqueCorrection {
    /// Turns `z = H^-1 r` of the rod into `(H - sum [tau]x / 2)^-1 r`.
    pub fn apply(
        &mut self,
        system: &System,
        blocks: &Range<usize>,
        zone: &Range<usize>,
        torque: &[DVec3],
        z: &mut [DVec3],
    ) {
        self.nodes.clear();
        self.nodes.extend(blocks.clone().filter(|e| torque[*e] != DVec3::ZERO).map(|e| 2 * e + 1));
        let n = 3 * self.nodes.len();
        if n == 0 {
            return;
        }
        while self.columns.len() < n {
            self.columns.push(Vec::new());
        }
        // Columns y = H^-1 e for each component of each loaded node.
        for k in 0..n {
            let y = &mut self.columns[k];
            y.clear();
            y.resize(z.len(), DVec3::ZERO);
            y[self.nodes[k / 3]][k % 3] = 1.0;
            system.solve(blocks.clone(), zone, y);
        }
        // With E the selection of the loaded nodes and B = diag([tau]x / 2): (H - E B E^T)^-1 r = z + Y (I - B E^T
        // Y)^-1 B E^T z.
        self.dense.clear();
        self.dense.resize(n * n, 0.0);
        self.right.clear();
        self.right.resize(n, 0.0);
        for (a, node) in self.nodes.iter().enumerate() {
            let b = skew(torque[node / 2]) * 0.5;
            let bz = b * z[*node];
            for i in 0..3 {
                self.right[3 * a + i] = bz[i];
            }
            for k in 0..n {
                let by = b * self.columns[k][*node];
                for i in 0..3 {
                    self.dense[(3 * a + i) * n + k] = f64::from(u8::from(3 * a + i == k)) - by[i];
                }
            }
        }
        if !crate::math::solve_dense(&mut self.dense, &mut self.right, n) {
            return;
        }
        for k in 0..n {
            for node in 2 * blocks.start..2 * blocks.end {
                z[node] += self.columns[k][node] * self.right[k];
            }
        }
    }
}
