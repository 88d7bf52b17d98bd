//! Strings that users read: errors, warnings, notes, help, progress, reports and studies, collected from the sources.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, Group, Literal, TokenStream, TokenTree};
use tiprub_tests::root;

/// Derives whose doc comments are help texts.
const HELP: [&str; 4] = ["Args", "Parser", "Subcommand", "ValueEnum"];
/// Attributes whose strings users read.
const SHOWN: [&str; 3] = ["arg", "command", "value"];

/// One string literal.
#[derive(Debug)]
struct UserString {
    line: usize,
    text: String,
}

/// Returns whether tokens contain a word.
fn has_word(stream: &TokenStream, word: &str) -> bool {
    stream.clone().into_iter().any(|token| match token {
        TokenTree::Ident(ident) => ident == word,
        TokenTree::Group(group) => has_word(&group.stream(), word),
        _ => false,
    })
}

/// Returns the value of a string literal.
fn string_value(literal: &str) -> Option<String> {
    if let Some(raw) = literal.strip_prefix('r') {
        return Some(raw.trim_matches('#').trim_matches('"').to_owned());
    }
    let inner = literal.strip_prefix('"')?.strip_suffix('"')?;
    let mut text = String::new();
    let mut letters = inner.chars().peekable();
    while let Some(letter) = letters.next() {
        if letter != '\\' {
            text.push(letter);
            continue;
        }
        match letters.next() {
            Some('n') => text.push('\n'),
            Some('\n') => while letters.next_if(|next| next.is_whitespace()).is_some() {},
            Some(other) => text.push(other),
            None => {}
        }
    }
    Some(text)
}

/// Returns whether a string is a sentence or part of one: two words of letters, neither markup nor code.
fn is_prose(text: &str) -> bool {
    let words = text.split_whitespace().filter(|word| {
        let word = word.trim_matches(|letter: char| !letter.is_alphabetic());
        word.len() > 1 && word.chars().all(|letter| letter.is_alphabetic() || "'-".contains(letter))
    });
    let markup = text.trim_start().starts_with('<') || text.contains("px;");
    !markup && words.count() >= 2
}

/// Collects the strings of a sequence of tokens. If `help` is true, doc comments are help texts.
fn collect(stream: TokenStream, help: bool, found: &mut Vec<UserString>) {
    let tokens: Vec<TokenTree> = stream.into_iter().collect();
    let (mut index, mut helps) = (0, help);
    while index < tokens.len() {
        let attribute = match (&tokens[index], tokens.get(index + 1)) {
            (TokenTree::Punct(punct), Some(TokenTree::Group(group)))
                if punct.as_char() == '#' && group.delimiter() == Delimiter::Bracket =>
            {
                Some(group.clone())
            }
            _ => None,
        };
        // `#![…]` of a file.
        if is_punct(tokens.get(index), '#') && is_punct(tokens.get(index + 1), '!') {
            index += 3;
            continue;
        }
        if let Some(attribute) = attribute {
            index += 2;
            if is_test(&attribute) {
                index = end_of_item(&tokens, index);
                helps = help;
                continue;
            }
            helps |= is_derive_of_help(&attribute);
            let name = attribute.stream().into_iter().next().map(|name| name.to_string()).unwrap_or_default();
            if SHOWN.contains(&name.as_str()) || (helps && name == "doc") {
                collect_literals(attribute.stream(), found);
            }
            continue;
        }
        match &tokens[index] {
            TokenTree::Group(group) => {
                let first = found.len();
                collect(group.stream(), helps, found);
                let is_block = group.delimiter() == Delimiter::Brace;
                if !is_block || !(helps || has_statements(&group.stream())) {
                    join(first, found);
                }
                if is_block {
                    helps = help;
                }
            }
            TokenTree::Literal(literal) => push(literal, found),
            TokenTree::Punct(punct) if punct.as_char() == ';' => helps = help,
            _ => {}
        }
        index += 1;
    }
}

fn is_punct(token: Option<&TokenTree>, sign: char) -> bool {
    matches!(token, Some(TokenTree::Punct(punct)) if punct.as_char() == sign)
}

/// Returns whether a block has statements or arms; otherwise it is the value of a structure.
fn has_statements(stream: &TokenStream) -> bool {
    stream.clone().into_iter().any(|token| is_punct(Some(&token), ';') || is_punct(Some(&token), '>'))
}

/// Joins the strings of one call to one message.
fn join(first: usize, found: &mut Vec<UserString>) {
    let texts: Vec<UserString> = found.drain(first..).collect();
    let Some(line) = texts.first().map(|one| one.line) else { return };
    let text = texts.into_iter().map(|one| one.text).collect::<Vec<_>>().join(" | ");
    found.push(UserString { line, text });
}

fn collect_literals(stream: TokenStream, found: &mut Vec<UserString>) {
    for token in stream {
        match token {
            TokenTree::Group(group) => collect_literals(group.stream(), found),
            TokenTree::Literal(literal) => push(&literal, found),
            _ => {}
        }
    }
}

fn push(literal: &Literal, found: &mut Vec<UserString>) {
    let Some(text) = string_value(&literal.to_string()).filter(|text| is_prose(text)) else { return };
    found.push(UserString { line: literal.span().start().line, text });
}

fn is_test(attribute: &Group) -> bool {
    let text = attribute.stream().to_string().replace(' ', "");
    text == "test" || text.starts_with("cfg(test") || text.starts_with("cfg(all(test")
}

fn is_derive_of_help(attribute: &Group) -> bool {
    attribute.stream().to_string().starts_with("derive") && HELP.iter().any(|name| has_word(&attribute.stream(), name))
}

/// Returns the index after the item that starts at `index`.
fn end_of_item(tokens: &[TokenTree], index: usize) -> usize {
    let ends = |token: &TokenTree| match token {
        TokenTree::Group(group) => group.delimiter() == Delimiter::Brace,
        TokenTree::Punct(punct) => punct.as_char() == ';',
        _ => false,
    };
    tokens[index..].iter().position(ends).map_or(tokens.len(), |end| index + end + 1)
}

/// Words that readers found hard to understand, and their replacements.
const BANNED: [(&str, &str); 20] = [
    ("told", "reported"),
    ("tells", "reports, warns, prints"),
    ("made for", "supported"),
    ("books", "energy balance"),
    ("asked for", "requested"),
    ("at once", "immediately"),
    ("a share of", "a fraction of"),
    ("digs in", "locks up"),
    ("marched", "integrated with adaptive steps"),
    ("what is left", "name it"),
    ("flies", "a free body"),
    ("what ships", "built-in"),
    ("nobody", "say what happens"),
    ("beyond all", "out of range"),
    ("of its own", "name it"),
    ("cannot be had", "unavailable"),
    ("who has", "if you have"),
    ("hangs on", "is connected to"),
    ("is none", "say what is wrong"),
    ("are none", "say what is wrong"),
];

/// Returns the text in lower case without placeholders, its words between single spaces.
fn plain_words(text: &str) -> String {
    let mut words = String::from(" ");
    let mut depth = 0_usize;
    for letter in text.to_lowercase().chars() {
        match letter {
            '{' => depth += 1,
            '}' => depth = depth.saturating_sub(1),
            _ if depth > 0 => {}
            _ if letter.is_alphanumeric() || letter == '\'' => words.push(letter),
            _ if words.ends_with(' ') => {}
            _ => words.push(' '),
        }
    }
    words.push(' ');
    words
}

/// Returns the Rust sources of the product and of its evidence below a folder, without tests.
fn product_sources(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    super::sources(folder, &mut files);
    let outside = ["tests", "benches", "examples"];
    let is_product = |path: &PathBuf| {
        let inside = path.strip_prefix(folder).expect("a file of the folder");
        !inside.components().any(|part| outside.iter().any(|name| part.as_os_str() == *name))
            && path.file_name().is_none_or(|name| name != "tests.rs" && name != "build.rs")
    };
    files.retain(is_product);
    files.sort();
    files
}

/// Also writes all strings to `target/messages.md` for review.
#[test]
fn user_visible_strings_avoid_confusing_words() {
    let (mut list, mut count, mut banned) = (String::from("# Strings that users read\n"), 0, Vec::new());
    for folder in ["src", "fmi", "modelDescription", "packaging", "tests/lab"] {
        for path in product_sources(&root().join(folder)) {
            let text = std::fs::read_to_string(&path).expect("a source file");
            let mut found = Vec::new();
            collect(text.parse().expect("Rust"), false, &mut found);
            let name = path.strip_prefix(root()).expect("a file of the project").display().to_string();
            if !found.is_empty() {
                let _ = write!(list, "\n## {name}\n\n");
            }
            for one in found {
                let _ = writeln!(list, "{}: {}  ", one.line, one.text.trim().replace('\n', "\\n"));
                let words = plain_words(&one.text);
                let wrong = BANNED.iter().filter(|(word, _)| words.contains(&format!(" {word} ")));
                banned.extend(wrong.map(|(word, instead)| format!("{name}:{}: `{word}`: {instead}", one.line)));
                count += 1;
            }
        }
    }
    std::fs::write(root().join("target/messages.md"), list).expect("the list can be written");
    assert!(count > 2000, "{count} strings found");
    assert!(banned.is_empty(), "write in plain English:\n{}", banned.join("\n"));
}

#[test]
fn strings_of_a_call_form_one_message_and_tests_are_skipped() {
    let source = r##"
        //! Ordinary documentation of a file.
        /// Ordinary documentation of a function.
        fn f() -> Result<()> {
            return Err(Error::invalid(format!("key `{key}`"), "is out of range", "Give a smaller value"));
        }
        #[derive(Debug, Args)]
        struct Options {
            /// Help of an option.
            #[arg(long, help = "More words of help")]
            one: bool,
        }
        #[cfg(test)]
        mod tests {
            const TEXT: &str = "words of a test";
        }
        const SVG: &str = "<svg width and height>";
        const LAST: &str = "the last words";
    "##;
    let mut found = Vec::new();
    collect(source.parse().expect("Rust"), false, &mut found);
    let texts: Vec<&str> = found.iter().map(|one| one.text.trim()).collect();
    assert_eq!(
        texts,
        [
            "key `{key}` | is out of range | Give a smaller value",
            "Help of an option.",
            "More words of help",
            "the last words"
        ]
    );
}
