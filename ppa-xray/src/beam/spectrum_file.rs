//! Spectrum files: two-column CSV and MC-GPU's `.spc`.

use std::path::Path;

use crate::{beam::spectrum::Spectrum, beam::spectrum_error::SpectrumError};

impl Spectrum {
    /// Reads lines of `energy in keV, weight`, where the energy is the centre of a bin; edges are half-way between centres.
    ///
    /// The columns are separated by comma, semicolon, tab or blanks. Lines that are empty or begin with `#` are skipped, and so
    /// is one headline.
    ///
    /// # Errors
    /// A file that cannot be read, a line that is not two numbers, fewer than two lines, and the errors of
    /// [`Spectrum::from_bins`].
    pub fn from_csv(path: impl AsRef<Path>) -> Result<Self, SpectrumError> {
        in_file(path.as_ref(), csv)
    }

    /// Reads an MC-GPU spectrum: lines of `lower bin edge in eV, weight`, ended by the upper edge with a negative weight.
    /// A single bin without width is a spectral line.
    ///
    /// # Errors
    /// A file that cannot be read, a line that does not begin with two numbers, no end, a negative weight after which
    /// the energies rise further (MC-GPU would ignore the rest), and the errors of [`Spectrum::from_bins`].
    pub fn from_spc(path: impl AsRef<Path>) -> Result<Self, SpectrumError> {
        in_file(path.as_ref(), spc)
    }
}

/// Reads a file; errors name it.
fn in_file(
    path: &Path,
    parse: impl FnOnce(&str) -> Result<Spectrum, SpectrumError>,
) -> Result<Spectrum, SpectrumError> {
    ppa_core::regular_file::read_to_string(path)
        .map_err(SpectrumError::Read)
        .and_then(|text| parse(&text))
        .map_err(|source| SpectrumError::File {
            path: path.to_owned(),
            source: Box::new(source),
        })
}

fn csv(text: &str) -> Result<Spectrum, SpectrumError> {
    let mut rows = Vec::new();
    let mut headline_allowed = true;
    for (index, line) in lines(text) {
        let columns: Vec<&str> = columns(line).collect();
        match columns[..]
            .iter()
            .map(|column| column.parse::<f64>())
            .collect::<Result<Vec<_>, _>>()
        {
            Ok(numbers) if numbers.len() == 2 => rows.push((numbers[0], numbers[1])),
            Err(_) if headline_allowed => {}
            _ => {
                return Err(wrong_line(index, line, "bin centre in keV and weight"));
            }
        }
        headline_allowed = false;
    }
    if rows.len() < 2 {
        return Err(wrong_line(
            text.lines().count(),
            "",
            "at least two energy bins",
        ));
    }
    let middle = |pair: &[(f64, f64)]| 0.5 * (pair[0].0 + pair[1].0);
    let inner: Vec<f64> = rows.windows(2).map(middle).collect();
    let (first, last) = (rows[0].0, rows[rows.len() - 1].0);
    let mut edges = vec![2.0 * first - inner[0]];
    edges.extend_from_slice(&inner);
    edges.push(2.0 * last - inner[inner.len() - 1]);
    Spectrum::from_bins(&edges, &rows.iter().map(|row| row.1).collect::<Vec<_>>())
}

fn spc(text: &str) -> Result<Spectrum, SpectrumError> {
    const EXPECTED: &str = "lower bin edge in eV and weight";
    let (mut edges, mut weights) = (Vec::new(), Vec::new());
    let mut lines = lines(text);
    while let Some((index, line)) = lines.next() {
        let (energy_ev, weight) =
            two_numbers(line).ok_or_else(|| wrong_line(index, line, EXPECTED))?;
        edges.push(energy_ev / 1000.0);
        if weight < 0.0 {
            let mut rest = lines.filter_map(|(_, line)| two_numbers(line));
            if rest.any(|(further_ev, _)| further_ev > energy_ev) {
                let expected =
                    "a negative weight at the highest energy only, where it ends the spectrum";
                return Err(wrong_line(index, line, expected));
            }
            return match (&edges[..], &weights[..]) {
                // Notation of a spectral line: a bin without width.
                ([low, high], [weight]) if low == high && *weight > 0.0 => {
                    Spectrum::monoenergetic(*low)
                }
                _ => Spectrum::from_bins(&edges, &weights),
            };
        }
        weights.push(weight);
    }
    Err(wrong_line(
        text.lines().count(),
        "",
        "an upper edge with a negative weight at the end",
    ))
}

/// Lines with content, with their index.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.lines().map(str::trim).enumerate();
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

fn columns(line: &str) -> impl Iterator<Item = &str> {
    line.split(|c: char| c.is_whitespace() || c == ',' || c == ';')
        .filter(|column| !column.is_empty())
}

/// The first two columns.
fn two_numbers(line: &str) -> Option<(f64, f64)> {
    let mut columns = columns(line).map(|column| column.parse().ok());
    Some((columns.next()??, columns.next()??))
}

fn wrong_line(index: usize, found: &str, expected: &'static str) -> SpectrumError {
    SpectrumError::Line {
        line: index + 1,
        found: found.to_owned(),
        expected,
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use proptest::prelude::*;

    use super::*;
    use crate::mcgpu::mangled;

    fn file(text: &str) -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        file
    }

    #[test]
    fn csv_centres_and_spc_edges_mean_the_same_bins() {
        let csv = Spectrum::from_csv(file("keV,weight\n20.5,1\n21.5,3\n22.5,0\n").path()).unwrap();
        let spc = Spectrum::from_spc(
            file("# MC-GPU\n20000 2 # low\n21000 6\n22000 0\n23000 -1\n99 9\n").path(),
        )
        .unwrap();
        assert_eq!(csv, spc);
        assert_eq!(csv.edges_kev(), [20.0, 21.0, 22.0]);
        assert_eq!(csv.bins().collect::<Vec<_>>(), [(20.5, 0.25), (21.5, 0.75)]);
        let line = Spectrum::from_spc(file("56400 1\n56400 -1\n").path()).unwrap();
        assert_eq!(line, Spectrum::monoenergetic(56.4).unwrap());
    }

    #[test]
    fn bad_files_are_refused_with_the_reason() {
        let in_file = |error: SpectrumError| match error {
            SpectrumError::File { source, .. } => *source,
            other => other,
        };
        let csv = |text| in_file(Spectrum::from_csv(file(text).path()).unwrap_err());
        assert!(matches!(
            csv("20,1\n21,x\n"),
            SpectrumError::Line { line: 2, .. }
        ));
        assert!(matches!(
            csv("20,1\n21,-3\n"),
            SpectrumError::Weight { bin: 1, .. }
        ));
        assert!(matches!(
            csv("20,1\n21,NaN\n"),
            SpectrumError::Weight { bin: 1, .. }
        ));
        assert!(matches!(
            csv("21,1\n20,1\n"),
            SpectrumError::Edges { bin: 0, .. }
        ));
        assert!(matches!(csv("20,0\n21,0\n"), SpectrumError::Dark));
        assert!(matches!(
            csv("149.5,1\n151,1\n"),
            SpectrumError::Range { .. }
        ));
        assert!(matches!(csv(""), SpectrumError::Line { .. }));
        let spc = |text| in_file(Spectrum::from_spc(file(text).path()).unwrap_err());
        assert!(matches!(
            spc("20000 1\n21000 1\n"),
            SpectrumError::Line { .. }
        ));
        assert!(matches!(spc("20000 -1\n"), SpectrumError::Dark));
        assert!(matches!(
            spc("20000 1\n30000 -5\n40000 1\n50000 -1\n"),
            SpectrumError::Line { line: 2, .. }
        ));
        assert!(matches!(
            in_file(Spectrum::from_spc("nowhere.spc").unwrap_err()),
            SpectrumError::Read(_)
        ));
    }

    proptest! {
        /// Reading any file returns a spectrum or an error.
        #[test]
        fn any_text_is_read_or_refused(text in "([-0-9.eNainf#, \n]{0,12}\n?){0,12}") {
            let file = file(&text);
            let _ = Spectrum::from_csv(file.path());
            let _ = Spectrum::from_spc(file.path());
        }

        /// The same for valid files that were damaged.
        #[test]
        fn a_damaged_file_is_read_or_refused(damage in mangled::damage()) {
            let csv = "keV,weight\n20.5,1\n21.5,3\n22.5,0\n23.5,2\n";
            let _ = mangled::read(&mangled::damaged(csv.as_bytes(), &damage), |path| Spectrum::from_csv(path));
            let spc = "# MC-GPU\n20000 2 # low\n21000 6\n22000 0\n23000 -1\n";
            let _ = mangled::read(&mangled::damaged(spc.as_bytes(), &damage), |path| Spectrum::from_spc(path));
        }
    }
}
