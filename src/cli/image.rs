//! Colours that are read: the pixels of a .png, and the rows of a table.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use png::{BitDepth, ColorType, Transformations};

use super::exit::Usage;
use super::has_extension;

/// The most bytes of a table of colours.
const MOST: u64 = 512 << 20;

/// The most pixels of an image.
const MOST_PIXELS: u64 = 1 << 28;

/// An image: red, green and blue of each pixel, 0 to 1, row by row.
pub(super) struct Image {
    pub(super) width: u64,
    height: u64,
    pixels: Vec<[f32; 3]>,
}

/// Whether a path is that of an image, by its extension.
pub(super) fn is_image(path: &str) -> bool {
    has_extension(path, "png")
}

fn refused(path: &str, reason: impl std::fmt::Display) -> anyhow::Error {
    Usage(format!("{path:?}: {reason}")).into()
}

/// Reads a .png: grey or colour, of up to 16 bits. What is transparent has the colour that it would have if it were not.
pub(super) fn read(path: &str) -> anyhow::Result<Image> {
    let file = File::open(path).map_err(|e| refused(path, e))?;
    let mut decoder = png::Decoder::new(BufReader::new(file));
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(|e| refused(path, e))?;
    let (width, height) = (u64::from(reader.info().width), u64::from(reader.info().height));
    if width * height > MOST_PIXELS {
        return Err(refused(
            path,
            format!("{width} x {height} pixels, and {MOST_PIXELS} are the most: crop it"),
        ));
    }
    let size = reader.output_buffer_size().ok_or_else(|| refused(path, "it is too large"))?;
    let mut bytes = vec![0; size];
    let frame = reader.next_frame(&mut bytes).map_err(|e| refused(path, e))?;
    let channels = match frame.color_type {
        ColorType::Grayscale => 1,
        ColorType::GrayscaleAlpha => 2,
        ColorType::Rgb | ColorType::Indexed => 3,
        ColorType::Rgba => 4,
    };
    let values: Vec<f32> = match frame.bit_depth {
        BitDepth::Sixteen => {
            bytes.chunks_exact(2).map(|b| f32::from(u16::from_be_bytes([b[0], b[1]])) / 65535.0).collect()
        }
        _ => bytes.iter().map(|&byte| f32::from(byte) / 255.0).collect(),
    };
    let pixel = |values: &[f32]| match channels {
        1 | 2 => [values[0]; 3],
        _ => [values[0], values[1], values[2]],
    };
    let pixels: Vec<_> = values.chunks_exact(channels).take((width * height) as usize).map(pixel).collect();
    Ok(Image { width, height, pixels })
}

impl Image {
    /// The part that was asked for, as its first column and row, its width and its height: the whole, where none was.
    pub(super) fn part(&self, crop: &[u64]) -> Result<[u64; 4], Usage> {
        let (width, height) = (self.width, self.height);
        match *crop {
            [] => Ok([0, 0, width, height]),
            [x, y, w, h]
                if w > 0 && h > 0 && x.saturating_add(w) <= width && y.saturating_add(h) <= height =>
            {
                Ok([x, y, w, h])
            }
            [_, _, _, _] => Err(Usage(format!(
                "--crop {}: the image has {width} x {height} pixels",
                crop.iter().map(u64::to_string).collect::<Vec<_>>().join(",")
            ))),
            _ => Err(Usage("--crop takes four numbers, as in 0,0,64,64".to_owned())),
        }
    }

    /// The pixels of a part, row by row.
    pub(super) fn pixels(&self, [x, y, width, height]: [u64; 4]) -> impl Iterator<Item = [f64; 3]> + '_ {
        let row = move |row: u64| &self.pixels[((y + row) * self.width + x) as usize..][..width as usize];
        (0..height).flat_map(row).map(|pixel| pixel.map(f64::from))
    }
}

/// Reads a table of colours of so many numbers each.
pub(super) fn table(path: &str, width: usize) -> anyhow::Result<Vec<Vec<f64>>> {
    if !Path::new(path).exists() {
        return Err(refused(path, "there is no file of this name"));
    }
    let text = spectroll::plain_file::read_text(Path::new(path), MOST).map_err(|e| refused(path, e))?;
    rows(&text, width).map_err(|reason| refused(path, reason))
}

/// The colours of a text.
fn rows(text: &str, width: usize) -> Result<Vec<Vec<f64>>, String> {
    let mut colours = Vec::new();
    let mut has_heading = false;
    for (number, line) in (1..).zip(text.trim_start_matches('\u{feff}').lines()) {
        let line = line.split('#').next().unwrap_or_default();
        let words: Vec<&str> = line
            .split([',', ';', '\t', ' ', '\r'])
            .map(|word| word.trim_matches('"'))
            .filter(|word| !word.is_empty())
            .collect();
        if words.is_empty() {
            continue;
        }
        let numbers: Vec<Option<f64>> = words.iter().map(|word| word.parse().ok()).collect();
        if numbers.iter().all(Option::is_none) && colours.is_empty() && !has_heading {
            has_heading = true;
            continue;
        }
        if words.len() != width {
            let found = words.len();
            return Err(format!("line {number}: {found} values, where a colour has {width} here"));
        }
        let colour = numbers.iter().zip(&words).map(|(value, word)| match value {
            Some(value) if value.is_finite() => Ok(*value),
            _ => Err(format!("line {number}: {word:?} is no number of a colour")),
        });
        colours.push(colour.collect::<Result<Vec<f64>, _>>()?);
    }
    match colours.is_empty() {
        true => Err("it has no colours: write one in each row".to_owned()),
        false => Ok(colours),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_of_colours_come_in_many_forms() {
        let expected = Ok(vec![vec![0.1, 0.2, 0.3], vec![0.4, 0.5, 0.6]]);
        for text in [
            "0.1,0.2,0.3\n0.4,0.5,0.6\n",
            "X,Y,Z\r\n0.1,0.2,0.3\r\n0.4,0.5,0.6",
            "# colours\n0.1 0.2 0.3 # the first\n\n0.4\t0.5\t0.6",
            "\"X\";\"Y\";\"Z\"\n0.1;0.2;0.3\n0.4;0.5;0.6\n",
        ] {
            assert_eq!(rows(text, 3), expected, "{text:?}");
        }
        for (text, message) in [
            ("", "it has no colours"),
            ("X,Y,Z\n", "it has no colours"),
            ("0.1,0.2\n", "line 1: 2 values, where a colour has 3"),
            ("0.1,0.2,x\n", "line 1: \"x\" is no number"),
            ("0.1,0.2,nan\n", "line 1: \"nan\" is no number"),
            ("a,b,c\nd,e,f\n", "line 2: \"d\" is no number"),
        ] {
            let error = rows(text, 3).unwrap_err();
            assert!(error.contains(message), "{text:?}: {error}");
        }
    }

    #[test]
    fn images_of_every_kind_have_the_same_pixels() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, color, depth, bytes: &[u8]| {
            let path = folder.path().join(name);
            let mut encoder = png::Encoder::new(File::create(&path).unwrap(), 2, 1);
            encoder.set_color(color);
            encoder.set_depth(depth);
            encoder.write_header().unwrap().write_image_data(bytes).unwrap();
            path.display().to_string()
        };
        let paths = [
            write("a.png", ColorType::Rgb, BitDepth::Eight, &[255, 0, 51, 0, 102, 255]),
            write("b.png", ColorType::Rgba, BitDepth::Eight, &[255, 0, 51, 255, 0, 102, 255, 0]),
            write(
                "c.png",
                ColorType::Rgb,
                BitDepth::Sixteen,
                &[255, 255, 0, 0, 51, 51, 0, 0, 102, 102, 255, 255],
            ),
        ];
        for path in paths {
            let image = read(&path).unwrap();
            let pixels: Vec<_> = image.pixels([0, 0, 2, 1]).collect();
            let is = |found: [f64; 3], expected: [f64; 3]| {
                found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6)
            };
            assert!(is(pixels[0], [1.0, 0.0, 0.2]) && is(pixels[1], [0.0, 0.4, 1.0]), "{path} {pixels:?}");
            assert_eq!(image.pixels([1, 0, 1, 1]).count(), 1);
            assert!(
                image.part(&[1, 0, 2, 1]).unwrap_err().to_string().contains("the image has 2 x 1 pixels")
            );
            assert!(image.part(&[1, 0]).is_err());
        }
        let grey = read(&write("d.png", ColorType::Grayscale, BitDepth::Eight, &[255, 51])).unwrap();
        let pixels: Vec<_> = grey.pixels(grey.part(&[]).unwrap()).collect();
        assert_eq!(pixels[0], [1.0; 3]);
        assert!(read(&folder.path().join("none.png").display().to_string()).is_err());
    }
}
