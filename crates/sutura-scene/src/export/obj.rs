//! Wavefront OBJ: an object a thread and shape, with texture coordinates and normals.

use super::{ExportError, Moment, Output, Seen, Writer, fitted};
use std::fmt::Write as _;
use sutura::skin::{Bone, TriangleMesh};

/// The number of files, and the last text where there is to be one.
#[derive(Default)]
pub struct Obj {
    last: Option<String>,
    number: usize,
}

impl Obj {
    pub fn new() -> Self {
        Obj::default()
    }

    fn text(seen: &Seen<'_>, moment: &Moment) -> String {
        let Seen { header, looks } = seen;
        let mut text = format!("# Sutura {}, meters, {} s\n", env!("CARGO_PKG_VERSION"), moment.time);
        let (mut vertices, mut textures) = (1, 1);
        let mut put = |name: &str, mesh: &TriangleMesh, positions: &[[f32; 3]], normals: &[[f32; 3]]| {
            // Writing to a string cannot fail.
            // A name ends at a blank.
            let _ = writeln!(text, "o {}", name.split_whitespace().collect::<Vec<_>>().join("_"));
            for [x, y, z] in positions {
                let _ = writeln!(text, "v {x} {y} {z}");
            }
            for [u, v] in &mesh.uvs {
                let _ = writeln!(text, "vt {u} {v}");
            }
            for [x, y, z] in normals {
                let _ = writeln!(text, "vn {x} {y} {z}");
            }
            for t in &mesh.triangles {
                let _ = write!(text, "f");
                for i in t {
                    let i = *i as usize;
                    let texture = if mesh.uvs.is_empty() { String::new() } else { (textures + i).to_string() };
                    let _ = write!(text, " {}/{texture}/{}", vertices + i, vertices + i);
                }
                text.push('\n');
            }
            vertices += positions.len();
            textures += mesh.uvs.len();
        };
        for ((skin, strand), thread) in looks.skins.iter().zip(&moment.threads).zip(&header.threads) {
            let mut bones = vec![Bone::default(); skin.n_bones()];
            skin.bones_at(&strand.positions, &strand.orientations, &mut bones);
            let (mut positions, mut normals) = (vec![[0.0; 3]; skin.n_vertices()], vec![[0.0; 3]; skin.n_vertices()]);
            skin.pose(&bones, &mut positions, &mut normals);
            put(&thread.name, skin.mesh(), &positions, &normals);
        }
        for ((mesh, pose), shape) in looks.shapes.iter().zip(&moment.shapes).zip(&header.shapes) {
            let placed = mesh.placed(pose);
            put(&shape.name, &placed, &placed.positions, &placed.normals);
        }
        text
    }
}

impl Writer for Obj {
    fn add(&mut self, seen: &Seen<'_>, moment: &Moment, out: &mut Output) -> Result<(), ExportError> {
        let text = Self::text(seen, &fitted(seen.header, moment));
        if out.is_one_file() {
            self.last = Some(text);
            return Ok(());
        }
        let name = format!("frame_{:05}.obj", self.number);
        self.number += 1;
        out.write(Some(&name), text.as_bytes())
    }

    fn finish(self: Box<Self>, _: &Seen<'_>, out: &mut Output) -> Result<(), ExportError> {
        self.last.map_or(Ok(()), |text| out.write(None, text.as_bytes()))
    }
}
