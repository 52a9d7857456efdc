//! VTK PolyData (`.vtp`) of each moment with collections (`.pvd`) that say when: threads as polylines with fields,
//! shapes as surfaces.
//!
//! Names and fields are constants, so that nothing needs escaping, and the format is a dozen tags: the crates for VTK
//! bring a parser of the old format and three compressors.

use super::{ExportError, Looks, Moment, Output, Seen, Strand, Writer};
use crate::trajectory::{Header, Thread, ThreadLook};
use base64::Engine as _;
use std::fmt::Write as _;
use sutura::glam::{DQuat, DVec3};
use sutura::{Pose, Profile, Section};

/// Which file holds which time.
#[derive(Default)]
pub struct Vtk {
    threads: Vec<(f64, String)>,
    shapes: Vec<(f64, String)>,
    /// Where the shapes were when they were written last.
    placed: Option<Vec<Pose>>,
}

/// A file of points, lines or triangles, and fields.
struct PolyData {
    points: Vec<f32>,
    /// Points of each line or triangle.
    cells: Vec<Vec<i32>>,
    /// Name of the cells: `Lines` or `Polys`.
    kind: &'static str,
    point_fields: Vec<Field>,
    cell_fields: Vec<Field>,
}

struct Field {
    name: &'static str,
    components: usize,
    values: Vec<f32>,
}

impl Vtk {
    pub fn new() -> Self {
        Vtk::default()
    }

    fn surfaces(looks: &Looks, moment: &Moment) -> PolyData {
        let mut data = PolyData {
            points: Vec::new(),
            cells: Vec::new(),
            kind: "Polys",
            point_fields: Vec::new(),
            cell_fields: Vec::new(),
        };
        let (mut normals, mut which) = (Vec::new(), Vec::new());
        for (k, (mesh, pose)) in looks.shapes.iter().zip(&moment.shapes).enumerate() {
            let first = (data.points.len() / 3) as i32;
            let mesh = mesh.placed(pose);
            data.points.extend(mesh.positions.iter().flatten());
            normals.extend(mesh.normals.iter().flatten());
            which.extend(mesh.triangles.iter().map(|_| k as f32));
            data.cells.extend(mesh.triangles.iter().map(|t| t.map(|i| first + i as i32).to_vec()));
        }
        data.point_fields.push(Field { name: "Normals", components: 3, values: normals });
        data.cell_fields.push(Field { name: "shape", components: 1, values: which });
        data
    }
}

impl Writer for Vtk {
    fn add(&mut self, seen: &Seen<'_>, moment: &Moment, out: &mut Output) -> Result<(), ExportError> {
        let number = self.threads.len();
        let name = format!("threads_{number:05}.vtp");
        out.write(Some(&name), threads(seen.header, moment).text().as_bytes())?;
        self.threads.push((moment.time, name));
        if moment.shapes.is_empty() {
            return Ok(());
        }
        // Shapes that stay where they are stand in one file.
        if self.placed.as_ref() != Some(&moment.shapes) {
            let name = format!("shapes_{number:05}.vtp");
            out.write(Some(&name), Self::surfaces(seen.looks, moment).text().as_bytes())?;
            self.shapes.push((moment.time, name));
            self.placed = Some(moment.shapes.clone());
        } else if let Some((_, name)) = self.shapes.last().cloned() {
            self.shapes.push((moment.time, name));
        }
        Ok(())
    }

    fn finish(self: Box<Self>, _: &Seen<'_>, out: &mut Output) -> Result<(), ExportError> {
        for (name, files) in [("threads.pvd", &self.threads), ("shapes.pvd", &self.shapes)] {
            if files.is_empty() {
                continue;
            }
            let mut text = String::from(
                "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n<Collection>\n",
            );
            for (time, file) in files {
                let _ = writeln!(text, "<DataSet timestep=\"{time}\" part=\"0\" file=\"{file}\"/>");
            }
            text.push_str("</Collection>\n</VTKFile>\n");
            out.write(Some(name), text.as_bytes())?;
        }
        Ok(())
    }
}

/// All threads as polylines with their fields.
fn threads(header: &Header, moment: &Moment) -> PolyData {
    let mut data = PolyData {
        points: Vec::new(),
        cells: Vec::new(),
        kind: "Lines",
        point_fields: Vec::new(),
        cell_fields: Vec::new(),
    };
    let mut fields: Vec<Field> = Vec::new();
    let mut which = Vec::new();
    for (k, (thread, strand)) in header.threads.iter().zip(&moment.threads).enumerate() {
        let first = (data.points.len() / 3) as i32;
        let n = strand.positions.len() as i32;
        data.points.extend(strand.positions.iter().flat_map(|x| x.as_vec3().to_array()));
        data.cells.push((first..first + n).collect());
        which.push(k as f32);
        for (i, field) in fields_of(thread, strand).into_iter().enumerate() {
            match fields.get_mut(i) {
                Some(all) => all.values.extend(field.values),
                None => fields.push(field),
            }
        }
    }
    data.point_fields = fields;
    data.cell_fields.push(Field { name: "thread", components: 1, values: which });
    data
}

/// Fields at the particles. What belongs to elements is the mean of the two at a particle.
fn fields_of(thread: &Thread, strand: &Strand) -> Vec<Field> {
    let (x, q) = (&strand.positions, &strand.orientations);
    let n = q.len();
    let lengths: Vec<f64> = x.windows(2).map(|w| (w[1] - w[0]).length()).collect();
    let look = thread.look.as_ref();
    let arc: Vec<f64> = std::iter::once(0.0)
        .chain(lengths.iter().scan(0.0, |sum, l| {
            *sum += l;
            Some(*sum)
        }))
        .collect();
    // Bend and twist from frame to frame, at the joint between two elements and at the seam of a closed thread.
    let seam = look.and_then(|l| l.seam);
    let joint = |before: usize, after: usize, rest: DQuat| {
        let turn = sutura::math::log((q[before].conjugate() * q[after] * rest).normalize());
        turn / (0.5 * (lengths[before] + lengths[after])).max(f64::MIN_POSITIVE)
    };
    let at_end = seam.map_or(DVec3::ZERO, |turn| joint(n - 1, 0, DQuat::from_rotation_z(-turn)));
    let darboux: Vec<DVec3> =
        (0..=n).map(|i| if i == 0 || i == n { at_end } else { joint(i - 1, i, DQuat::IDENTITY) }).collect();
    let around = |i: usize| {
        if i == 0 || i == n {
            if seam.is_some() { (n - 1, 0) } else { (i.min(n - 1), i.min(n - 1)) }
        } else {
            (i - 1, i)
        }
    };
    let scalar = |name, value: &dyn Fn(usize) -> f64| Field {
        name,
        components: 1,
        values: (0..=n).map(|i| value(i) as f32).collect(),
    };
    let vector = |name, value: &dyn Fn(usize) -> DVec3| Field {
        name,
        components: 3,
        values: (0..=n).flat_map(|i| value(i).as_vec3().to_array()).collect(),
    };
    let radius = radius(thread, look);
    let director = |axis: DVec3| {
        move |i: usize| {
            let (a, b) = around(i);
            (q[a] * axis + q[b] * axis).normalize_or(q[b] * axis)
        }
    };
    let mut fields = vec![
        scalar("arc", &|i| arc[i]),
        scalar("radius", &|i| radius(arc[i])),
        scalar("curvature", &|i| darboux[i].x.hypot(darboux[i].y)),
        scalar("twist", &|i| darboux[i].z),
        vector("d1", &director(DVec3::X)),
        vector("d2", &director(DVec3::Y)),
        vector("d3", &director(DVec3::Z)),
    ];
    if let Some(loads) = &strand.loads {
        let mean = |i: usize| {
            let (a, b) = around(i);
            0.5 * (loads.tensions[a] + loads.tensions[b])
        };
        fields.push(scalar("tension", &mean));
        fields.push(vector("contact_force", &|i| loads.contact_forces[i]));
    }
    if let Some(velocities) = &strand.velocities {
        fields.push(vector("velocity", &|i| velocities[i]));
    }
    fields
}

/// Radius along a thread, or half the larger width of a section that is not round \[m\].
fn radius(thread: &Thread, look: Option<&ThreadLook>) -> impl Fn(f64) -> f64 {
    let width = look.and_then(|l| Section::from(l.section).half_width()).unwrap_or(thread.radius);
    let size = Profile(look.map(|l| l.size.clone()).unwrap_or_default());
    move |arc| width * size.at(arc)
}

impl PolyData {
    fn text(&self) -> String {
        let mut text = String::from(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt32\">\n",
        );
        let (points, cells) = (self.points.len() / 3, self.cells.len());
        let (lines, polys) = if self.kind == "Lines" { (cells, 0) } else { (0, cells) };
        let _ = writeln!(
            text,
            "<PolyData>\n<Piece NumberOfPoints=\"{points}\" NumberOfVerts=\"0\" NumberOfLines=\"{lines}\" NumberOfStrips=\"0\" NumberOfPolys=\"{polys}\">"
        );
        let _ = writeln!(text, "<Points>");
        floats(&mut text, "Points", 3, &self.points);
        let _ = writeln!(text, "</Points>\n<{}>", self.kind);
        let connectivity: Vec<i32> = self.cells.iter().flatten().copied().collect();
        let offsets: Vec<i32> = self
            .cells
            .iter()
            .scan(0, |sum, c| {
                *sum += c.len() as i32;
                Some(*sum)
            })
            .collect();
        integers(&mut text, "connectivity", &connectivity);
        integers(&mut text, "offsets", &offsets);
        let _ = writeln!(text, "</{}>", self.kind);
        for (tag, fields) in [("PointData", &self.point_fields), ("CellData", &self.cell_fields)] {
            let _ = writeln!(text, "<{tag}>");
            for f in fields {
                floats(&mut text, f.name, f.components, &f.values);
            }
            let _ = writeln!(text, "</{tag}>");
        }
        text.push_str("</Piece>\n</PolyData>\n</VTKFile>\n");
        text
    }
}

fn floats(text: &mut String, name: &str, components: usize, values: &[f32]) {
    array(text, "Float32", name, components, values.iter().flat_map(|v| v.to_le_bytes()));
}

fn integers(text: &mut String, name: &str, values: &[i32]) {
    array(text, "Int32", name, 1, values.iter().flat_map(|v| v.to_le_bytes()));
}

/// An array as base64 of its length in bytes and its bytes.
fn array(text: &mut String, kind: &str, name: &str, components: usize, values: impl Iterator<Item = u8>) {
    let mut bytes = vec![0; 4];
    bytes.extend(values);
    let length = (bytes.len() - 4) as u32;
    bytes[..4].copy_from_slice(&length.to_le_bytes());
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    let _ = writeln!(
        text,
        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"binary\">{data}</DataArray>"
    );
}
