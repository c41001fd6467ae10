//! Linked cells for points that move one at a time, one grid per class of radii (factors of two), so
//! that a wide size distribution does not crowd the cells of its largest particles.

/// A box with its low corner at the origin.
#[derive(Debug, Clone, Copy)]
pub struct Cell {
    /// Sides \[m\].
    pub sides: [f64; 3],
    /// Which axes are periodic.
    pub periodic: [bool; 3],
}

impl Cell {
    /// The box's volume \[m³\].
    #[must_use]
    pub fn volume(&self) -> f64 {
        self.sides[0] * self.sides[1] * self.sides[2]
    }
}

/// A sphere's place and size.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(32))]
pub struct Ball {
    /// Centre within the cell \[m\].
    pub position: [f64; 3],
    /// Radius \[m\].
    pub radius: f64,
}

/// A periodic image: how many cells away, and that as a length \[m\].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Image {
    /// Integer shift per axis.
    pub shift: [i8; 3],
    /// The shift times the sides \[m\].
    pub offset: [f64; 3],
}

impl Image {
    /// From one ball to this image of another \[m\].
    #[inline]
    #[must_use]
    pub fn separation(&self, from: &Ball, to: &Ball) -> [f64; 3] {
        [0, 1, 2].map(|k| to.position[k] + self.offset[k] - from.position[k])
    }
}

const NONE: u32 = u32::MAX;
/// Searches reach a little further than asked, so that rounding of cell borders loses nothing.
const MARGIN: f64 = 1.0 + 1e-9;

#[derive(Debug)]
struct Level {
    first: usize,
    cells: [i64; 3],
    per_length: [f64; 3],
    max_radius: f64,
}

/// Linked cells over all balls, by classes of radii from the largest down.
#[derive(Debug)]
pub struct Grid {
    cell: Cell,
    levels: Vec<Level>,
    head: Vec<u32>,
    next: Vec<u32>,
    /// Linked cell that holds each ball.
    place: Vec<u32>,
    level: Vec<u8>,
}

/// Class of a radius: how often it can be doubled without passing the largest.
#[must_use]
pub fn size_class(radius: f64, largest: f64) -> u8 {
    let (mut class, mut bound) = (0, 0.5 * largest);
    while radius <= bound && class < 30 {
        class += 1;
        bound *= 0.5;
    }
    class
}

impl Grid {
    /// Grid whose cells are as wide as the diameter times `scale` of the largest ball in each class.
    #[must_use]
    pub fn new(cell: Cell, balls: &[Ball], scale: f64) -> Self {
        let mut grid = Self::empty(cell, balls, scale);
        for (index, ball) in balls.iter().enumerate() {
            grid.add(index, ball.position);
        }
        grid
    }

    /// A grid for these balls that holds none of them yet.
    #[must_use]
    pub fn empty(cell: Cell, balls: &[Ball], scale: f64) -> Self {
        let largest = balls.iter().map(|ball| ball.radius).fold(0.0, f64::max);
        let classes: Vec<u8> = balls.iter().map(|ball| size_class(ball.radius, largest)).collect();
        let mut levels = Vec::new();
        let mut level_of_class = [0_u8; 32];
        let mut first = 0;
        for class in 0..32_u8 {
            let of_class = || balls.iter().zip(&classes).filter(|(_, of)| **of == class).map(|(ball, _)| ball.radius);
            let count = of_class().count();
            if count == 0 {
                continue;
            }
            level_of_class[usize::from(class)] = levels.len() as u8;
            let max_radius = of_class().fold(0.0, f64::max);
            let cells = cell_counts(&cell, 2.0 * scale * max_radius * MARGIN, count);
            let per_length = [0, 1, 2].map(|k| cells[k] as f64 / cell.sides[k]);
            levels.push(Level { first, cells, per_length, max_radius });
            first += (cells[0] * cells[1] * cells[2]) as usize;
        }
        let level = classes.iter().map(|class| level_of_class[usize::from(*class)]).collect();
        let empty = vec![NONE; balls.len()];
        Self { cell, levels, head: vec![NONE; first], next: empty.clone(), place: empty, level }
    }

    /// Put a ball that the grid does not hold yet into its linked cell.
    pub fn add(&mut self, index: usize, position: [f64; 3]) {
        self.insert(index, self.place_of(index, position));
    }

    /// The linked cell of a ball, as a key to sort by.
    #[must_use]
    pub fn place(&self, index: usize) -> u32 {
        self.place[index]
    }

    /// Tell the grid that a ball has moved.
    #[inline]
    pub fn update(&mut self, index: usize, position: [f64; 3]) {
        let place = self.place_of(index, position);
        if place != self.place[index] {
            self.remove(index);
            self.insert(index, place);
        }
    }

    fn place_of(&self, index: usize, position: [f64; 3]) -> u32 {
        let level = &self.levels[usize::from(self.level[index])];
        let [x, y, z] = [0, 1, 2].map(|k| ((position[k] * level.per_length[k]) as i64).clamp(0, level.cells[k] - 1));
        (level.first as i64 + (z * level.cells[1] + y) * level.cells[0] + x) as u32
    }

    fn insert(&mut self, index: usize, place: u32) {
        self.place[index] = place;
        self.next[index] = self.head[place as usize];
        self.head[place as usize] = index as u32;
    }

    fn remove(&mut self, index: usize) {
        let place = self.place[index] as usize;
        if self.head[place] == index as u32 {
            self.head[place] = self.next[index];
            return;
        }
        let mut before = self.head[place] as usize;
        while self.next[before] != index as u32 {
            before = self.next[before] as usize;
        }
        self.next[before] = self.next[index];
    }

    /// Call `visit` for every image of every ball that may be nearer to ball `index` than `scale`
    /// times the sum of radii (and for some further ones), the ball itself and its images included.
    /// With `larger_only`, only balls of its own and of larger classes.
    #[inline]
    pub fn visit_near(
        &self,
        index: usize,
        ball: &Ball,
        scale: f64,
        larger_only: bool,
        mut visit: impl FnMut(usize, Image),
    ) {
        let levels = if larger_only { usize::from(self.level[index]) + 1 } else { self.levels.len() };
        for level in &self.levels[..levels] {
            let reach = scale * (ball.radius + level.max_radius) * MARGIN;
            let [x_range, y_range, z_range] = [0, 1, 2].map(|k| self.range(level, k, ball.position[k], reach));
            for z in z_range.0..=z_range.1 {
                let (z, z_shift) = wrap_index(z, level.cells[2]);
                for y in y_range.0..=y_range.1 {
                    let (y, y_shift) = wrap_index(y, level.cells[1]);
                    let row = level.first as i64 + (z * level.cells[1] + y) * level.cells[0];
                    for x in x_range.0..=x_range.1 {
                        let (x, x_shift) = wrap_index(x, level.cells[0]);
                        let mut other = self.head[(row + x) as usize];
                        if other == NONE {
                            continue;
                        }
                        let shift = [x_shift, y_shift, z_shift];
                        let image =
                            Image { shift, offset: [0, 1, 2].map(|k| f64::from(shift[k]) * self.cell.sides[k]) };
                        while other != NONE {
                            visit(other as usize, image);
                            other = self.next[other as usize];
                        }
                    }
                }
            }
        }
    }

    /// Cells along `axis` that hold what lies within `reach` of `centre`, before wrapping.
    #[inline]
    fn range(&self, level: &Level, axis: usize, centre: f64, reach: f64) -> (i64, i64) {
        let low = floor((centre - reach) * level.per_length[axis]);
        let high = floor((centre + reach) * level.per_length[axis]);
        if self.cell.periodic[axis] { (low, high) } else { (low.max(0), high.min(level.cells[axis] - 1)) }
    }
}

/// Cells per axis of at least this width, and not many more than `count` of them.
fn cell_counts(cell: &Cell, width: f64, count: usize) -> [i64; 3] {
    let sparse = libm::cbrt(cell.volume() / (2.0 * count as f64));
    let width = width.max(sparse);
    cell.sides.map(|side| ((side / width) as i64).max(1))
}

/// Largest integer not above `value`, without the library call that `f64::floor` is on old targets.
#[inline]
fn floor(value: f64) -> i64 {
    let truncated = value as i64;
    truncated - i64::from(truncated as f64 > value)
}

/// An index along a periodic axis and the image that it lies in.
#[inline]
fn wrap_index(index: i64, count: i64) -> (i64, i8) {
    if index >= 0 && index < count { (index, 0) } else { (index.rem_euclid(count), index.div_euclid(count) as i8) }
}
