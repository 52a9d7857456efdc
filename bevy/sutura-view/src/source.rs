//! What is shown: a scene that is played, or a recorded trajectory.

use std::path::Path;
use sutura_bevy::sutura::glam::DVec3;
use sutura_bevy::sutura::input::{Recorder, Recording};
use sutura_bevy::sutura::skin::SkinSpec;
use sutura_bevy::sutura::{Grip, Handle, Incident, Profile, Rod, World};
use sutura_bevy::{Part, Simulation};
use sutura_scene::{Mover, Runner, Scene, Thread, Trajectory, samples};

/// A scene that is played. When its phases are over the world goes on by itself, for hands from outside.
pub struct Play(pub Runner);

impl Play {
    /// The thing of the scene that this is.
    fn mover(&self, part: Part) -> Option<Mover> {
        match part {
            Part::Grip(grip) => self.0.grips().position(|g| g.1 == Some(grip)).map(Mover::Grip),
            Part::Body(body) => self.0.shapes().position(|s| s.1 == body).map(Mover::Shape),
        }
    }
    /// Everything that was taken over goes back to where the scene has it, no faster than this \[m/s\], but what is
    /// held still; how many things do.
    pub fn give_back(&mut self, held: &[Part], speed: f64) -> usize {
        let held: Vec<Mover> = held.iter().filter_map(|p| self.mover(*p)).collect();
        let lent: Vec<Mover> = self.0.lent().filter(|m| !held.contains(m)).collect();
        lent.iter().for_each(|m| self.0.give_back(*m, speed));
        lent.len()
    }
}

impl Simulation for Play {
    fn world(&self) -> &World {
        self.0.world()
    }
    fn edit(&mut self) -> &mut Recorder {
        self.0.edit()
    }
    fn recording(&self) -> Option<&Recording> {
        self.0.recording_so_far()
    }
    fn step(&mut self, _dt: f64, drive: &mut dyn FnMut(&mut Recorder, f64)) -> Vec<Incident> {
        if self.0.now().finished {
            return self.0.step_beyond(drive);
        }
        self.0.step_frame_with(drive);
        Vec::new()
    }
    fn limit_work(&mut self, most: Option<f64>) {
        self.0.limit_work(most);
    }
    fn hold(&mut self, part: Part, held: bool) -> bool {
        let Some(what) = self.mover(part) else { return false };
        if held {
            return self.0.lend(what);
        }
        self.0.leave(what);
        true
    }
    fn grip_at(&self, thread: Handle<Rod>, particle: usize) -> Option<Handle<Grip>> {
        let world = self.0.world();
        let x = world.rod(thread).ok()?.positions();
        // A jaw holds the middle of an element.
        let near = |p: DVec3| {
            let at = |i: usize| x.get(i).copied();
            let length = at(particle + 1).or(at(particle.wrapping_sub(1)))?.distance(at(particle)?);
            let middles = [particle.wrapping_sub(1), particle].map(|i| Some((at(i)? + at(i + 1)?) * 0.5));
            Some(middles.into_iter().flatten().chain(at(particle)).any(|q| p.distance(q) < 1e-3 * length))
        };
        self.0
            .grips()
            .filter_map(|(_, h)| h)
            .find(|h| world.grip_pose(*h).ok().and_then(|pose| near(pose.position)) == Some(true))
    }
}

/// What was opened.
pub enum Source {
    /// A scene, at its beginning.
    Scene(Box<Scene>),
    /// A recording.
    Recorded(Box<Trajectory>),
}

impl Source {
    /// Opens a scene file, a recorded trajectory, or a sample scene by name. The error is for people.
    pub fn open(name: &str) -> Result<Source, String> {
        let path = Path::new(name);
        if path.is_file() {
            let mut start = [0; 8];
            let file = std::fs::File::open(path).and_then(|mut f| std::io::Read::read(&mut f, &mut start));
            return match file {
                Ok(8) if &start == b"SUTURATR" => Trajectory::read_from(path)
                    .map(|t| Source::Recorded(Box::new(t)))
                    .map_err(|e| format!("{name}: {e}")),
                Ok(_) => Scene::load(path).map(|s| Source::Scene(Box::new(s))).map_err(|e| e.to_string()),
                Err(e) => Err(format!("{name}: {e}")),
            };
        }
        match samples().iter().find(|s| s.name == name) {
            Some(sample) => Scene::parse(sample.text, &format!("{name}.toml"))
                .map(|s| Source::Scene(Box::new(s)))
                .map_err(|e| e.to_string()),
            None => {
                let names: Vec<&str> = samples().iter().map(|s| s.name).collect();
                Err(format!(
                    "{name}: there is no such file, and no sample scene of that name. There are: {}",
                    names.join(", ")
                ))
            }
        }
    }
}

/// The skin of a thread of a recording, whose first positions are these \[m\].
pub fn skin(thread: &Thread, positions: &[[f32; 3]]) -> SkinSpec {
    let place = |p: [f32; 3]| DVec3::from_array(p.map(f64::from));
    // Recordings of earlier versions have no rest lengths; a thread whose ends meet is taken for a closed one.
    let lengths = || positions.windows(2).map(|w| place(w[0]).distance(place(w[1])).max(1e-9)).collect();
    match &thread.look {
        Some(look) => SkinSpec {
            section: look.section.into(),
            size: Profile(look.size.clone()),
            seam: look.seam,
            ..SkinSpec::new(look.lengths.clone(), thread.radius)
        },
        None => SkinSpec {
            seam: (positions.len() > 3 && positions.first() == positions.last()).then_some(0.0),
            ..SkinSpec::new(lengths(), thread.radius)
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_opened_says_why() {
        let message = |r: Result<Source, String>| r.err().unwrap();
        assert!(message(Source::open("capstam")).contains("capstan"));
        let folder = tempfile::tempdir().unwrap();
        let bad = folder.path().join("bad.toml");
        std::fs::write(&bad, "[[thread]]\nlenght = \"10 cm\"\n").unwrap();
        let said = message(Source::open(bad.to_str().unwrap()));
        assert!(said.contains("bad.toml:2") && said.contains("lenght: unknown key"), "{said}");
        let cut = folder.path().join("cut.sutura");
        std::fs::write(&cut, b"SUTURATR and no more").unwrap();
        assert!(message(Source::open(cut.to_str().unwrap())).contains("recording"));
        assert!(matches!(Source::open("capstan"), Ok(Source::Scene(_))));
    }
}
