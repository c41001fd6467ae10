//! The way of one sphere over a bed of fixed ones, down to where it rests. Without inertia: it moves along
//! the steepest descent that its contacts leave, on arcs of circles, from one event to the next.

use super::super::grid::{Ball, Grid};
use super::descent::{Descent, descent};
use super::{cross, dot, minus};

/// A sphere of the bed, one of its images, as the moving sphere touches it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Contact {
    /// Number of the sphere in the bed.
    ball: usize,
    /// Its centre, image shift included \[m\].
    pub centre: [f64; 3],
    /// Sum of the two radii \[m\].
    pub reach: f64,
}

/// Spheres at rest and the floor, z = 0, below them.
#[derive(Debug)]
pub(super) struct Bed<'a> {
    /// All balls; those in the grid are at rest.
    pub balls: &'a [Ball],
    /// The balls at rest.
    pub grid: &'a Grid,
    /// Height of the highest point of the bed \[m\].
    pub top: f64,
    /// Radius of the largest ball \[m\].
    pub largest: f64,
}

/// Shorter ways than this, relative to the radius, are none: all contacts met on them count together.
const STANDSTILL: f64 = 1e-9;
/// A contact that was left is met again only at a larger angle than this; rounding makes smaller ones.
const LEAVING: f64 = 1e-6;
/// More arcs than any sphere needs.
const MAX_LEGS: usize = 100_000;

/// What ends a leg of the way.
enum Event {
    Floor,
    Touch(Contact),
    /// The contact of this number in the active ones no longer pushes.
    Release(usize),
}

/// A leg on the way: from `from` to `to` \[rad\] on the circle `centre + radius (p cos φ + q sin φ)`, p the
/// direction of steepest ascent in its plane, q horizontal.
struct Arc {
    centre: [f64; 3],
    radius: f64,
    p: [f64; 3],
    q: [f64; 3],
    from: f64,
    to: f64,
}

impl Arc {
    fn at(&self, angle: f64) -> [f64; 3] {
        let (sine, cosine) = libm::sincos(angle);
        [0, 1, 2].map(|k| self.centre[k] + self.radius * (self.p[k] * cosine + self.q[k] * sine))
    }

    /// Where the sphere on this arc begins to overlap `with`, if it does before the end. A contact that the
    /// sphere is leaving (`left`) is met only if the arc leads into it all the same, or back to it.
    fn meets(&self, with: &Contact, left: bool) -> Option<f64> {
        let d = minus(with.centre, self.centre);
        let (a, b) = (dot(self.p, d), dot(self.q, d));
        // Overlap wherever a cos φ + b sin φ > level.
        let level = (self.radius * self.radius + dot(d, d) - with.reach * with.reach) / (2.0 * self.radius);
        let square = a * a + b * b;
        if level > 0.0 && level * level >= square {
            return None;
        }
        let middle = libm::atan2(b, a);
        let half = libm::acos((level / square.sqrt()).max(-1.0));
        for middle in [middle, middle + 2.0 * std::f64::consts::PI] {
            // Beyond the middle of the overlap the sphere comes out of it, as far as rounding let it in.
            let entry = middle - half;
            if middle <= self.from || entry >= self.to {
                continue;
            }
            if left && entry < self.from + LEAVING {
                let (sine, cosine) = libm::sincos(self.from);
                if b * cosine - a * sine < LEAVING * with.reach {
                    continue;
                }
            }
            return Some(entry.max(self.from));
        }
        None
    }
}

impl Bed<'_> {
    /// Where a sphere of this radius comes to rest that is let go above (x, y), and how many legs it took;
    /// `None` if it does not come to rest. `tie` \[rad\]: the way it rolls off the very top of a sphere.
    pub fn settle(&self, radius: f64, [x, y]: [f64; 2], tie: f64) -> Option<([f64; 3], usize)> {
        let mut position = [x, y, self.top + radius];
        // Contacts that carry the sphere, and all those that it touches or has just left.
        let (mut active, mut touching): (Vec<Contact>, Vec<Contact>) = (Vec::new(), Vec::new());
        for legs in 0..MAX_LEGS {
            let (to, event) = match active[..] {
                [] => self.fall(radius, position, &touching),
                [on] => self.roll_on_one(radius, position, &on, &touching, tie),
                [first, second, ..] => self.roll_on_two(radius, position, [&first, &second], &touching),
            };
            let way = minus(to, position);
            if dot(way, way) > (STANDSTILL * radius) * (STANDSTILL * radius) {
                touching.clone_from(&active);
            }
            position = to;
            match event {
                Event::Floor => return Some((position, legs)),
                Event::Release(number) => {
                    active.remove(number);
                }
                Event::Touch(contact) => {
                    if !touching.contains(&contact) {
                        touching.push(contact);
                    }
                    match descent(position, &touching) {
                        Descent::Rest => return Some((position, legs)),
                        Descent::On(chosen) => active = chosen,
                    }
                }
            }
        }
        None
    }

    /// Straight down to the floor or the highest sphere in the way.
    fn fall(&self, radius: f64, position: [f64; 3], left: &[Contact]) -> ([f64; 3], Event) {
        let [x, y, start] = position;
        let window = radius.max(0.25 * self.largest);
        let mut upper = start;
        let mut found: Option<(f64, Contact)> = None;
        loop {
            // Every sphere that stops this one between upper − 2 window and upper.
            let probe = Ball { position: [x, y, upper - window], radius: radius + window };
            self.visit(&probe, radius, |contact| {
                let d = minus(contact.centre, position);
                let square = contact.reach * contact.reach - d[0] * d[0] - d[1] * d[1];
                if square <= 0.0 || d[2] >= 0.0 || left.contains(&contact) {
                    return;
                }
                let height = (contact.centre[2] + square.sqrt()).min(start);
                if height > radius && found.is_none_or(|(highest, _)| height > highest) {
                    found = Some((height, contact));
                }
            });
            upper -= 2.0 * window;
            match found {
                Some((height, contact)) if height >= upper => return ([x, y, height], Event::Touch(contact)),
                None if upper <= radius => return ([x, y, radius], Event::Floor),
                _ => {}
            }
        }
    }

    /// Down the meridian of one sphere, at most to its equator.
    fn roll_on_one(
        &self,
        radius: f64,
        position: [f64; 3],
        on: &Contact,
        touching: &[Contact],
        tie: f64,
    ) -> ([f64; 3], Event) {
        let d = minus(position, on.centre);
        let across = (d[0] * d[0] + d[1] * d[1]).sqrt();
        let q = if across > 1e-12 * on.reach {
            [d[0] / across, d[1] / across, 0.0]
        } else {
            [libm::cos(tie), libm::sin(tie), 0.0]
        };
        let equator = 0.5 * std::f64::consts::PI;
        let from = libm::atan2(across, d[2]).min(equator);
        let arc = Arc { centre: on.centre, radius: on.reach, p: [0.0, 0.0, 1.0], q, from, to: equator };
        self.follow(radius, arc, &[on], touching, 0)
    }

    /// Down the circle of points that touch two spheres, until one of them no longer carries.
    fn roll_on_two(
        &self,
        radius: f64,
        position: [f64; 3],
        on: [&Contact; 2],
        touching: &[Contact],
    ) -> ([f64; 3], Event) {
        let between = minus(on[1].centre, on[0].centre);
        let square = dot(between, between);
        let distance = square.sqrt();
        let axis = between.map(|x| x / distance);
        let [s, t] = on.map(|contact| contact.reach * contact.reach);
        let along = (square + s - t) / (2.0 * distance);
        let circle = (s - along * along).max(0.0).sqrt();
        let centre = [0, 1, 2].map(|k| on[0].centre[k] + along * axis[k]);
        let steep = (1.0 - axis[2] * axis[2]).max(f64::MIN_POSITIVE).sqrt();
        let p = [-axis[2] * axis[0] / steep, -axis[2] * axis[1] / steep, steep];
        let mut q = cross(axis, p);
        let d = minus(position, centre);
        if dot(q, d) < 0.0 {
            q = q.map(|x| -x);
        }
        let from = libm::atan2(dot(q, d), dot(p, d)).max(0.0);
        // Contact k pushes as long as n_k·z > (n_0·n_1) n_other·z, n the directions from the contacts to the sphere.
        let cosine = (s + t - square) / (2.0 * on[0].reach * on[1].reach);
        let mut release = (std::f64::consts::PI, 0);
        for number in [0, 1] {
            let (own, other) = (on[number], on[1 - number]);
            let slope = 1.0 / own.reach - cosine / other.reach;
            if slope > 0.0 {
                let height = (own.centre[2] / own.reach - cosine * other.centre[2] / other.reach) / slope;
                let relative = (height - centre[2]) / (circle * steep);
                let angle = if relative > -1.0 { libm::acos(relative.min(1.0)) } else { std::f64::consts::PI };
                if angle < release.0 {
                    release = (angle, number);
                }
            }
        }
        let arc = Arc { centre, radius: circle, p, q, from, to: release.0.max(from) };
        self.follow(radius, arc, &on, touching, release.1)
    }

    /// Along the arc to the first sphere or the floor in the way, or to its end, where the contact of number
    /// `released` is left.
    fn follow(
        &self,
        radius: f64,
        arc: Arc,
        on: &[&Contact],
        touching: &[Contact],
        released: usize,
    ) -> ([f64; 3], Event) {
        let mut end = arc.to;
        let mut event = Event::Release(released);
        // The floor: height = radius.
        let lowest = arc.centre[2] + arc.radius * arc.p[2] * libm::cos(end);
        if lowest < radius {
            let relative = (radius - arc.centre[2]) / (arc.radius * arc.p[2]);
            end = libm::acos(relative.clamp(-1.0, 1.0)).max(arc.from);
            event = Event::Floor;
        }
        let probe = Ball { position: arc.centre, radius: arc.radius + radius };
        self.visit(&probe, radius, |contact| {
            if on.iter().any(|on| **on == contact) {
                return;
            }
            let left = touching.contains(&contact);
            if let Some(angle) = arc.meets(&contact, left).filter(|angle| *angle < end) {
                end = angle;
                event = Event::Touch(contact);
            }
        });
        let mut position = arc.at(end);
        if matches!(event, Event::Floor) {
            position[2] = radius;
        }
        (position, event)
    }

    /// Every image of a ball at rest that a sphere of this radius may touch within the probe's reach.
    fn visit(&self, probe: &Ball, radius: f64, mut each: impl FnMut(Contact)) {
        self.grid.visit_near(0, probe, 1.0, false, |ball, image| {
            let Ball { position, radius: other } = self.balls[ball];
            let centre = [0, 1, 2].map(|k| position[k] + image.offset[k]);
            each(Contact { ball, centre, reach: radius + other });
        });
    }
}
