//! Cuts as scenes see them: each maps the places of a thread onto its two parts.

use sutura::Place;

/// A thread before it is cut.
#[derive(Debug, Clone)]
pub struct Parting {
    /// Rest lengths of its elements \[m\].
    pub lengths: Vec<f64>,
    /// The thread is closed: its end is joined to its start.
    pub closed: bool,
    /// The particle at which it is cut.
    pub particle: usize,
}

impl Parting {
    /// One at the particle nearest to a place, as the engine takes it.
    pub fn at(lengths: &[f64], closed: bool, place: Place) -> Self {
        let n = lengths.len();
        let nearest = match place {
            Place::Start => 0,
            Place::End => n,
            Place::Particle(i) | Place::Element(i) => (i as usize).min(n),
            Place::Arc(s) => {
                let mut left = s;
                let e = lengths.iter().position(|l| {
                    let within = left <= *l;
                    left -= if within { 0.0 } else { *l };
                    within
                });
                e.map_or(n, |e| e + usize::from(left > 0.5 * lengths[e]))
            }
        };
        Parting { lengths: lengths.to_vec(), closed, particle: if closed && nearest == n { 0 } else { nearest } }
    }

    /// Lengths of the elements after the cut, and of those of the rest, which a closed thread has not.
    pub fn parts(&self) -> (Vec<f64>, Option<Vec<f64>>) {
        let (before, after) = self.lengths.split_at(self.particle);
        if self.closed { ([after, before].concat(), None) } else { (before.to_vec(), Some(after.to_vec())) }
    }

    /// Says whether a place goes with the rest, and where it is then.
    pub fn carry(&self, place: Place) -> (bool, Place) {
        let (n, k) = (self.lengths.len() as u32, self.particle as u32);
        let arc: f64 = self.lengths[..self.particle].iter().sum();
        if self.closed {
            let length: f64 = self.lengths.iter().sum();
            let turned = |i: u32| (i + n - k) % n;
            let now = match place {
                _ if k == 0 => place,
                Place::Start | Place::End => Place::Particle(n - k),
                Place::Particle(i) => Place::Particle(turned(i)),
                Place::Element(i) => Place::Element(turned(i)),
                Place::Arc(s) => Place::Arc(if s <= arc { s + length - arc } else { s - arc }),
            };
            return (false, now);
        }
        match place {
            Place::End => (true, Place::End),
            Place::Particle(i) if i >= k => (true, Place::Particle(i - k)),
            Place::Element(i) if i >= k => (true, Place::Element(i - k)),
            Place::Arc(s) if s > arc => (true, Place::Arc(s - arc)),
            _ => (false, place),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_go_with_their_part() {
        let lengths = [1.0, 2.0, 1.0, 2.0];
        let open = Parting::at(&lengths, false, Place::Arc(3.4));
        assert_eq!(open.particle, 2);
        assert_eq!(open.parts(), (vec![1.0, 2.0], Some(vec![1.0, 2.0])));
        for (place, want) in [
            (Place::Start, (false, Place::Start)),
            (Place::Particle(1), (false, Place::Particle(1))),
            (Place::Arc(3.0), (false, Place::Arc(3.0))),
            (Place::Particle(2), (true, Place::Particle(0))),
            (Place::Element(3), (true, Place::Element(1))),
            (Place::Arc(3.5), (true, Place::Arc(0.5))),
            (Place::End, (true, Place::End)),
        ] {
            assert_eq!(open.carry(place), want, "{place:?}");
        }
        let ring = Parting::at(&lengths, true, Place::Particle(1));
        assert_eq!(ring.parts(), (vec![2.0, 1.0, 2.0, 1.0], None));
        for (place, want) in [
            (Place::Start, Place::Particle(3)),
            (Place::End, Place::Particle(3)),
            (Place::Particle(2), Place::Particle(1)),
            (Place::Element(0), Place::Element(3)),
            (Place::Arc(0.5), Place::Arc(5.5)),
            (Place::Arc(2.0), Place::Arc(1.0)),
        ] {
            assert_eq!(ring.carry(place), (false, want), "{place:?}");
        }
        for (place, want) in [(Place::Start, 0), (Place::End, 4), (Place::Element(2), 2), (Place::Arc(5.1), 4)] {
            assert_eq!(Parting::at(&lengths, false, place).particle, want, "{place:?}");
        }
        assert_eq!(Parting::at(&lengths, true, Place::End).particle, 0);
    }
}
