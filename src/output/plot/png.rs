//! PNG files with a palette: a picture of lines has few colours, and is a third of the size so.

use crate::error::{Error, Result};
use png::{BitDepth, ColorType, Compression, Encoder, FilterType};
use rustc_hash::FxHashMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

/// Shades per channel to try, until the picture has at most 256 colours; six always do.
const SHADES: [u32; 5] = [52, 32, 18, 12, 6];

/// Write RGB pixels, row by row, as `path`.
///
/// # Errors
/// [`Error::File`] when the file cannot be written.
pub(super) fn write(path: &Path, pixels: &[u8], (width, height): (u32, u32)) -> Result<()> {
    let (palette, indices) = SHADES.iter().find_map(|shades| indexed(pixels, *shades)).unwrap_or_default();
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

/// Palette and index per pixel with so many shades per channel; none if that makes more than 256 colours.
fn indexed(pixels: &[u8], shades: u32) -> Option<(Vec<u8>, Vec<u8>)> {
    let steps = shades - 1;
    let rounded = |value: u8| (((u32::from(value) * steps + 127) / 255) * 255 / steps) as u8;
    let (mut palette, mut known) = (Vec::new(), FxHashMap::default());
    let mut indices = Vec::with_capacity(pixels.len() / 3);
    for pixel in pixels.chunks_exact(3) {
        let colour = [rounded(pixel[0]), rounded(pixel[1]), rounded(pixel[2])];
        let next = known.len();
        let index = *known.entry(colour).or_insert_with(|| {
            palette.extend(colour);
            next
        });
        indices.push(u8::try_from(index).ok()?);
    }
    Some((palette, indices))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_and_white_stay_and_many_colours_are_rounded() {
        let (palette, indices) = indexed(&[0, 0, 0, 255, 255, 255, 0, 0, 0], 52).expect("two colours");
        assert_eq!((palette, indices), (vec![0, 0, 0, 255, 255, 255], vec![0, 1, 0]));
        let all: Vec<u8> = (0..=255).flat_map(|r| (0..=255).flat_map(move |g| [r, g, r ^ g])).collect();
        assert!(indexed(&all, 52).is_none());
        let (palette, indices) = indexed(&all, 6).expect("at most 216 colours");
        assert!(palette.len() <= 3 * 216 && indices.len() == 65536);
    }
}
