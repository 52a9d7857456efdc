//! Saved states: a file from which another scene with the same threads and shapes can start.
//!
//! Beside the engine's snapshot it holds every taking, letting go, loading and unloading in order. Doing these again
//! gives the same handles in a fresh world, which then takes the snapshot.

use serde::{Deserialize, Serialize};
use std::path::Path;
use sutura::glam::DVec3;
use sutura::{Hold, LoadKind, Place};

/// Something that gave or took a handle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case")]
pub enum Event {
    Take {
        grip: String,
        thread: String,
        place: SavedPlace,
        hold: SavedHold,
    },
    LetGo {
        grip: String,
    },
    Load {
        load: String,
        thread: String,
        kind: SavedLoad,
    },
    Unload {
        load: String,
    },
    /// `part` names the rest, which a closed thread has not.
    Cut {
        thread: String,
        particle: u32,
        part: Option<String>,
    },
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SavedPlace {
    Start,
    End,
    Particle(u32),
    Element(u32),
    Arc(f64),
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SavedHold {
    Pin,
    Clamp,
    Jaw,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SavedLoad {
    Point { place: SavedPlace, force: [f64; 3], torque: [f64; 3] },
    Uniform { force_per_length: [f64; 3] },
    Mass { place: SavedPlace, mass: f64, inertia: [f64; 3] },
}

impl From<Place> for SavedPlace {
    fn from(p: Place) -> Self {
        match p {
            Place::Start => SavedPlace::Start,
            Place::End => SavedPlace::End,
            Place::Particle(i) => SavedPlace::Particle(i),
            Place::Element(i) => SavedPlace::Element(i),
            Place::Arc(s) => SavedPlace::Arc(s),
        }
    }
}

impl From<SavedPlace> for Place {
    fn from(p: SavedPlace) -> Self {
        match p {
            SavedPlace::Start => Place::Start,
            SavedPlace::End => Place::End,
            SavedPlace::Particle(i) => Place::Particle(i),
            SavedPlace::Element(i) => Place::Element(i),
            SavedPlace::Arc(s) => Place::Arc(s),
        }
    }
}

impl From<Hold> for SavedHold {
    fn from(h: Hold) -> Self {
        match h {
            Hold::Pin => SavedHold::Pin,
            Hold::Clamp => SavedHold::Clamp,
            Hold::Jaw => SavedHold::Jaw,
        }
    }
}

impl From<SavedHold> for Hold {
    fn from(h: SavedHold) -> Self {
        match h {
            SavedHold::Pin => Hold::Pin,
            SavedHold::Clamp => Hold::Clamp,
            SavedHold::Jaw => Hold::Jaw,
        }
    }
}

impl From<LoadKind> for SavedLoad {
    fn from(k: LoadKind) -> Self {
        match k {
            LoadKind::Point { place, force, torque } => {
                SavedLoad::Point { place: place.into(), force: force.to_array(), torque: torque.to_array() }
            }
            LoadKind::Uniform { force_per_length } => {
                SavedLoad::Uniform { force_per_length: force_per_length.to_array() }
            }
            LoadKind::Mass { place, mass, inertia } => {
                SavedLoad::Mass { place: place.into(), mass, inertia: inertia.to_array() }
            }
        }
    }
}

impl From<SavedLoad> for LoadKind {
    fn from(k: SavedLoad) -> Self {
        let v = DVec3::from_array;
        match k {
            SavedLoad::Point { place, force, torque } => {
                LoadKind::Point { place: place.into(), force: v(force), torque: v(torque) }
            }
            SavedLoad::Uniform { force_per_length } => LoadKind::Uniform { force_per_length: v(force_per_length) },
            SavedLoad::Mass { place, mass, inertia } => {
                LoadKind::Mass { place: place.into(), mass, inertia: v(inertia) }
            }
        }
    }
}

/// A saved state.
#[derive(Debug, Clone, PartialEq)]
pub struct SavedFile {
    pub events: Vec<Event>,
    pub snapshot: Vec<u8>,
}

const MAGIC: &[u8; 8] = b"SUTURAST";
const VERSION: u32 = 1;

impl SavedFile {
    pub fn read(path: &Path) -> Result<Self, String> {
        Self::from_bytes(&std::fs::read(path).map_err(|e| e.to_string())?)
    }
    /// `SUTURAST`, version, length of the events, events as JSON, snapshot, checksum.
    pub fn to_bytes(&self) -> Vec<u8> {
        let events = serde_json::to_vec(&self.events).unwrap_or_default();
        let mut out = Vec::with_capacity(24 + events.len() + self.snapshot.len());
        out.extend_from_slice(MAGIC);
        out.extend_from_slice(&VERSION.to_le_bytes());
        out.extend_from_slice(&(events.len() as u32).to_le_bytes());
        out.extend_from_slice(&events);
        out.extend_from_slice(&self.snapshot);
        let sum = crc32fast::hash(&out);
        out.extend_from_slice(&sum.to_le_bytes());
        out
    }
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        let word = |at: usize| bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
        if bytes.len() < 20 || &bytes[..8] != MAGIC {
            return Err("not a saved state (it does not begin with SUTURAST)".into());
        }
        match word(8) {
            Some(VERSION) => {}
            other => {
                return Err(format!(
                    "saved state of version {}, this program reads version {VERSION}",
                    other.unwrap_or(0)
                ));
            }
        }
        let (body, sum) = bytes.split_at(bytes.len() - 4);
        if sum != crc32fast::hash(body).to_le_bytes() {
            return Err("saved state: the checksum does not fit (cut short or changed)".into());
        }
        let length = word(12).unwrap_or(0) as usize;
        let events = body.get(16..16usize.saturating_add(length)).ok_or("saved state: cut short")?;
        let events = serde_json::from_slice(events).map_err(|e| format!("saved state: {e}"))?;
        Ok(SavedFile { events, snapshot: body[16 + length..].to_vec() })
    }
    /// Names of the grips that it knows.
    pub fn grips(&self) -> Vec<String> {
        self.names(|e| if let Event::Take { grip, .. } = e { Some(grip) } else { None })
    }
    /// Names of the loads that it knows.
    pub fn loads(&self) -> Vec<String> {
        self.names(|e| if let Event::Load { load, .. } = e { Some(load) } else { None })
    }
    fn names(&self, pick: impl Fn(&Event) -> Option<&String>) -> Vec<String> {
        let mut out: Vec<String> = Vec::new();
        for name in self.events.iter().filter_map(pick) {
            if !out.contains(name) {
                out.push(name.clone());
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_saved_state_reads_back_and_damage_is_noticed() {
        let file = SavedFile {
            events: vec![
                Event::Take {
                    grip: "left".into(),
                    thread: "silk".into(),
                    place: Place::Arc(0.1).into(),
                    hold: Hold::Jaw.into(),
                },
                Event::LetGo { grip: "left".into() },
            ],
            snapshot: vec![1, 2, 3],
        };
        let bytes = file.to_bytes();
        assert_eq!(SavedFile::from_bytes(&bytes).unwrap(), file);
        assert_eq!(file.grips(), ["left"]);
        for n in 0..bytes.len() {
            assert!(SavedFile::from_bytes(&bytes[..n]).is_err(), "cut at {n}");
        }
    }
}
