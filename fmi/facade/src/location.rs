//! Location of the resources directory: a URI in FMI 2.0, a native path in FMI 3.0.

use std::path::{Path, PathBuf};

/// Returns the directory given as `fmuResourceLocation` of `fmi2Instantiate`: `file:///path`, `file:/path` or
/// `file://localhost/path`, percent-encoded UTF-8. A plain absolute path is accepted too, because importers pass it.
///
/// # Errors
/// A location that is empty, has another scheme or host, is not absolute, has a damaged encoding or is not a directory;
/// the message contains it.
pub(crate) fn from_uri(location: &str) -> Result<PathBuf, String> {
    let remedy = "Pass the URI of the unpacked resources directory, such as file:///tmp/fmu/resources";
    if location.trim().is_empty() {
        return Err(format!("fmuResourceLocation is empty, but this FMU reads its model from there. {remedy}"));
    }
    if Path::new(location).is_absolute() {
        return existing(PathBuf::from(location), "fmuResourceLocation", remedy);
    }
    let scheme = location.get(..5).filter(|scheme| scheme.eq_ignore_ascii_case("file:"));
    if scheme.is_none() {
        return Err(format!("fmuResourceLocation \"{location}\" is not a file: URI. {remedy}"));
    }
    let decoded = path_of(&location[5..], cfg!(windows))
        .map_err(|problem| format!("fmuResourceLocation \"{location}\" {problem}. {remedy}"))?;
    existing(PathBuf::from(decoded), "fmuResourceLocation", remedy)
}

/// Returns the native path of the text after `file:`: on Windows a drive without the slash before it, and a host as
/// `\\host\share` (RFC 8089, appendix E).
fn path_of(rest: &str, windows: bool) -> Result<String, String> {
    let Some(after) = rest.strip_prefix("//") else {
        return Ok(without_slash_of_drive(&decode(rest)?, windows));
    };
    // `file://C:/fmu` and `file://C%3A%5Cfmu`, with one slash missing, as some importers write them.
    let whole = decode(after)?;
    if windows && whole.as_bytes().get(1) == Some(&b':') {
        return Ok(whole);
    }
    let (host, _) = after.split_once('/').unwrap_or((after, ""));
    let path = decode(&after[host.len()..])?;
    if host.is_empty() || host.eq_ignore_ascii_case("localhost") {
        return Ok(without_slash_of_drive(&path, windows));
    }
    match windows {
        true => Ok(format!("\\\\{host}{}", path.replace('/', "\\"))),
        false => Err(format!("is on another host, \"{host}\"")),
    }
}

fn without_slash_of_drive(path: &str, windows: bool) -> String {
    let drive = windows && path.starts_with('/') && path.as_bytes().get(2) == Some(&b':');
    path[usize::from(drive)..].to_owned()
}

/// Returns the directory given as `resourcePath` of `fmi3InstantiateCoSimulation`: an absolute native path, with or
/// without a separator at the end. A `file:` URI is accepted too, because importers pass it.
///
/// # Errors
/// A path that is empty, not absolute or not a directory; the message contains it.
pub(crate) fn from_native(path: &str) -> Result<PathBuf, String> {
    let remedy = "Pass the absolute native path of the unpacked resources directory, such as /tmp/fmu/resources/";
    if path.trim().is_empty() {
        return Err(format!("resourcePath is empty, but this FMU reads its model from there. {remedy}"));
    }
    if path.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("file:")) {
        return from_uri(path);
    }
    existing(PathBuf::from(path), "resourcePath", remedy)
}

fn existing(path: PathBuf, argument: &str, remedy: &str) -> Result<PathBuf, String> {
    if !path.is_absolute() {
        return Err(format!("{argument} \"{}\" is not absolute. {remedy}", path.display()));
    }
    if !path.is_dir() {
        return Err(format!("{argument} \"{}\" is not a readable directory. {remedy}", path.display()));
    }
    Ok(path)
}

/// Decodes percent-encoding (RFC 3986). A percent sign without two hexadecimal digits stands for itself.
fn decode(text: &str) -> Result<String, String> {
    let bytes = text.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut index = 0;
    while index < bytes.len() {
        let pair = bytes.get(index + 1..index + 3).filter(|_| bytes[index] == b'%');
        let digits = pair.and_then(|pair| std::str::from_utf8(pair).ok());
        let code = digits.filter(|pair| pair.bytes().all(|digit| digit.is_ascii_hexdigit()));
        match code.and_then(|pair| u8::from_str_radix(pair, 16).ok()) {
            Some(0) => return Err("contains an encoded NUL".into()),
            Some(byte) => {
                out.push(byte);
                index += 3;
            }
            None => {
                out.push(bytes[index]);
                index += 1;
            }
        }
    }
    String::from_utf8(out).map_err(|_| "is not UTF-8 after decoding".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a directory whose name contains a blank, an umlaut, a percent sign and zeros without a percent sign.
    fn directory() -> tempfile::TempDir {
        tempfile::Builder::new().prefix("tiprub location \u{fc} 50% off 4400-0041-").tempdir().unwrap()
    }

    #[test]
    fn accepts_every_form_of_the_resource_uri() {
        let directory = directory();
        let path = directory.path();
        let text = path.to_str().unwrap();
        let encoded = text.replace('%', "%25").replace(' ', "%20").replace('\u{fc}', "%C3%bc");
        for uri in [
            format!("file://{encoded}"),
            format!("file:{encoded}"),
            format!("file://localhost{encoded}"),
            format!("FILE://LOCALHOST{encoded}/"),
            format!("file://{text}"),
            format!("file:///{encoded}"),
            text.to_owned(),
            format!("{text}/"),
        ] {
            assert_eq!(from_uri(&uri).as_deref(), Ok(path), "{uri}");
        }
    }

    #[test]
    fn rejects_invalid_locations_with_remedy() {
        for (uri, reason) in [
            ("", "empty"),
            ("  ", "empty"),
            ("http://example.org/resources", "not a file: URI"),
            ("file://server/share/resources", "another host, \"server\""),
            ("file:relative/resources", "not absolute"),
            ("file:///tmp/a%00b", "NUL"),
            ("file:///tmp/%ff%fe", "UTF-8"),
            ("file:///no/such/directory", "not a readable directory"),
            ("f\u{fc}le", "not a file: URI"),
        ] {
            let message = from_uri(uri).unwrap_err();
            assert!(message.contains(reason) && message.contains("Pass the URI"), "{uri}: {message}");
        }
    }

    #[test]
    fn resolves_windows_drives_and_unc_paths() {
        for (rest, path) in [
            ("///C:/fmu/resources", "C:/fmu/resources"),
            ("/C:/fmu/resources", "C:/fmu/resources"),
            ("//C:/fmu/resources", "C:/fmu/resources"),
            ("//C%3A%5Cfmu%5Cresources", r"C:\fmu\resources"),
            ("//localhost/C:/a%20b", "C:/a b"),
            ("//server/share/a%20b/resources", r"\\server\share\a b\resources"),
            // Four slashes: the server is part of the path, as some importers write it.
            ("////server/share/resources", "//server/share/resources"),
        ] {
            assert_eq!(path_of(rest, true).as_deref(), Ok(path), "{rest}");
        }
        assert_eq!(path_of("///C:/fmu", false).as_deref(), Ok("/C:/fmu"));
        assert!(path_of("//server/share", false).unwrap_err().contains("another host"));
    }

    #[test]
    fn accepts_native_paths() {
        let directory = directory();
        let path = directory.path();
        let text = path.to_str().unwrap();
        assert_eq!(from_native(text).as_deref(), Ok(path));
        assert_eq!(from_native(&format!("{text}/")).as_deref(), Ok(path));
        assert_eq!(from_native(&format!("file://{}", text.replace('%', "%25"))).as_deref(), Ok(path));
        assert!(from_native("").unwrap_err().contains("empty"));
        assert!(from_native("resources").unwrap_err().contains("not absolute"));
        assert!(from_native("/no/such/directory").unwrap_err().contains("not a readable directory"));
    }
}
