//! The skin of a thread as meshes with no more bones each than the renderer takes.

use sutura::skin::Skin;

/// A piece of a skin that is one mesh.
#[derive(Debug, Clone, Default)]
pub(crate) struct Part {
    /// Its bones, by their numbers in the skin.
    pub bones: Vec<u16>,
    /// Its vertices, by their numbers in the skin.
    pub vertices: Vec<u32>,
    /// Bones of its vertices, by their numbers in `bones`.
    pub joints: Vec<[u16; 4]>,
    /// Corners of its triangles, by their numbers in `vertices`.
    pub indices: Vec<u32>,
}

/// Cuts a skin. Its triangles are in order along the thread, so a part is full when the next triangle would bring a
/// bone too many. What two parts share is in both, moved by the same bones: no seam is seen.
pub(crate) fn parts(skin: &Skin, most: usize) -> Vec<Part> {
    let mut out = vec![Part::default()];
    let mut bone_at: Vec<Option<u16>> = vec![None; skin.n_bones()];
    let mut vertex_at: Vec<Option<u32>> = vec![None; skin.n_vertices()];
    let bones_of = |v: u32| {
        let v = v as usize;
        skin.joints()[v].into_iter().zip(skin.weights()[v]).filter(|(_, w)| *w > 0.0).map(|(b, _)| b)
    };
    for triangle in &skin.mesh().triangles {
        let mut fresh: Vec<u16> =
            triangle.iter().flat_map(|v| bones_of(*v)).filter(|b| bone_at[usize::from(*b)].is_none()).collect();
        fresh.sort_unstable();
        fresh.dedup();
        if out[out.len() - 1].bones.len() + fresh.len() > most {
            out.push(Part::default());
            bone_at.fill(None);
            vertex_at.fill(None);
        }
        let last = out.len() - 1;
        let part = &mut out[last];
        for corner in triangle {
            let v = *corner as usize;
            let index = vertex_at[v].unwrap_or_else(|| {
                let mut joints = [0; 4];
                for (joint, (bone, weight)) in
                    joints.iter_mut().zip(skin.joints()[v].into_iter().zip(skin.weights()[v]))
                {
                    if weight > 0.0 {
                        *joint = *bone_at[usize::from(bone)].get_or_insert_with(|| {
                            part.bones.push(bone);
                            (part.bones.len() - 1) as u16
                        });
                    }
                }
                part.joints.push(joints);
                part.vertices.push(*corner);
                (part.vertices.len() - 1) as u32
            });
            vertex_at[v] = Some(index);
            part.indices.push(index);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use sutura::skin::SkinSpec;

    #[test]
    fn a_long_thread_is_cut_and_nothing_is_lost() {
        let skin = Skin::new(&SkinSpec::new(vec![1e-3; 700], 1e-4)).unwrap();
        let parts = parts(&skin, 256);
        assert_eq!(parts.len(), 3);
        assert_eq!(parts.iter().map(|p| p.indices.len() / 3).sum::<usize>(), skin.mesh().triangles.len());
        for part in &parts {
            assert!(part.bones.len() <= 256);
            for (v, joints) in part.vertices.iter().zip(&part.joints) {
                for k in (0..4).filter(|k| skin.weights()[*v as usize][*k] > 0.0) {
                    assert_eq!(part.bones[usize::from(joints[k])], skin.joints()[*v as usize][k]);
                }
            }
        }
        let corners =
            parts.iter().flat_map(|p| p.indices.iter().map(|i| p.vertices[*i as usize])).collect::<Vec<u32>>();
        assert_eq!(corners, skin.mesh().triangles.iter().flatten().copied().collect::<Vec<u32>>());
    }
}
