//! PNG files with a palette: a picture of lines has few colours, and is a third of the size so.

use crate::error::{Error, Result};
use png::{BitDepth, ColorType, Compression, Encoder, FilterType};
use rustc_hash::FxHashMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

/// Colours that a palette holds.
const COLOURS: usize = 256;

/// Write RGB pixels, row by row, as `path`.
///
/// # Errors
/// [`Error::File`] when the file cannot be written.
pub(super) fn write(path: &Path, pixels: &[u8], (width, height): (u32, u32)) -> Result<()> {
    let (palette, indices) = indexed(pixels);
    let failed = |reason: String| Error::File {
        path: path.to_path_buf(),
        message: format!("cannot write the picture: {reason}"),
    };
    let file = File::create(path).map_err(|error| failed(error.to_string()))?;
    let mut encoder = Encoder::new(BufWriter::new(file), width, height);
    encoder.set_color(ColorType::Indexed);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_palette(palette);
    encoder.set_compression(Compression::Best);
    encoder.set_filter(FilterType::NoFilter);
    let mut writer = encoder.write_header().map_err(|error| failed(error.to_string()))?;
    writer.write_image_data(&indices).map_err(|error| failed(error.to_string()))?;
    writer.finish().map_err(|error| failed(error.to_string()))
}

/// The most frequent colours, and for each pixel the index of its own or of the nearest one: areas and lines keep
/// their colours, and the thousands of shades at their edges lose a hair.
fn indexed(pixels: &[u8]) -> (Vec<u8>, Vec<u8>) {
    let colours = || pixels.chunks_exact(3).map(|pixel| [pixel[0], pixel[1], pixel[2]]);
    let mut count: FxHashMap<[u8; 3], u64> = FxHashMap::default();
    colours().for_each(|colour| *count.entry(colour).or_default() += 1);
    let mut order: Vec<([u8; 3], u64)> = count.into_iter().collect();
    order.sort_unstable_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
    let palette: Vec<[u8; 3]> = order.iter().take(COLOURS).map(|entry| entry.0).collect();
    let nearest = |colour: [u8; 3]| {
        let distance = |other: &[u8; 3]| {
            colour.iter().zip(other).map(|(a, b)| u32::from(a.abs_diff(*b)) * u32::from(a.abs_diff(*b))).sum::<u32>()
        };
        let index = (0..palette.len()).min_by_key(|index| distance(&palette[*index]));
        index.unwrap_or(0) as u8
    };
    let place: FxHashMap<[u8; 3], u8> = order.iter().map(|entry| (entry.0, nearest(entry.0))).collect();
    (palette.concat(), colours().map(|colour| place[&colour]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frequent_colours_stay_and_rare_ones_take_the_nearest() {
        assert_eq!(indexed(&[9, 9, 9, 255, 0, 0, 9, 9, 9]), (vec![9, 9, 9, 255, 0, 0], vec![0, 1, 0]));
        // 256 colours twice, and one once that is next to the last of them.
        let frequent = (0..=255).flat_map(|value| [0, value, 0]);
        let pixels: Vec<u8> = frequent.clone().chain(frequent).chain([1, 255, 0]).collect();
        let (palette, indices) = indexed(&pixels);
        assert_eq!((palette.len(), indices.len()), (3 * 256, 513));
        assert_eq!(indices[512], indices[255]);
    }
}
