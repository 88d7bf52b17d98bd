//! Small tree of XML elements, written with quick-xml.

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, Event};

use crate::text::clean;

/// XML element without text content: model descriptions only have attributes.
pub(crate) struct XmlElement {
    name: &'static str,
    attributes: Vec<(&'static str, String)>,
    children: Vec<XmlElement>,
}

impl XmlElement {
    pub(crate) fn new(name: &'static str) -> Self {
        Self { name, attributes: Vec::new(), children: Vec::new() }
    }

    /// Adds an attribute; the value is cleaned here and escaped on writing.
    pub(crate) fn with(mut self, key: &'static str, value: impl AsRef<str>) -> Self {
        self.attributes.push((key, clean(value.as_ref())));
        self
    }

    /// Adds an attribute if there is a value.
    pub(crate) fn with_some(self, key: &'static str, value: Option<impl AsRef<str>>) -> Self {
        match value {
            Some(value) => self.with(key, value),
            None => self,
        }
    }

    /// Adds an attribute if the text is not empty.
    pub(crate) fn with_text(self, key: &'static str, value: &str) -> Self {
        self.with_some(key, (!value.is_empty()).then_some(value))
    }

    pub(crate) fn child(mut self, child: XmlElement) -> Self {
        self.children.push(child);
        self
    }

    pub(crate) fn children(mut self, children: impl IntoIterator<Item = XmlElement>) -> Self {
        self.children.extend(children);
        self
    }

    /// Returns the element if it has children: the schemas forbid most empty lists.
    pub(crate) fn unless_empty(self) -> Option<Self> {
        (!self.children.is_empty()).then_some(self)
    }

    /// Returns the document with this element as its root.
    pub(crate) fn document(&self) -> String {
        let mut writer = Writer::new_with_indent(Vec::new(), b' ', 2);
        let declaration = BytesDecl::new("1.0", Some("UTF-8"), None);
        writer
            .write_event(Event::Decl(declaration))
            .and_then(|()| self.write(&mut writer))
            .expect("writing to memory does not fail");
        let mut text = String::from_utf8(writer.into_inner()).expect("the writer was given UTF-8 only");
        text.push('\n');
        text
    }

    fn write(&self, writer: &mut Writer<Vec<u8>>) -> std::io::Result<()> {
        let mut start = BytesStart::new(self.name);
        for (key, value) in &self.attributes {
            start.push_attribute((*key, value.as_str()));
        }
        if self.children.is_empty() {
            return writer.write_event(Event::Empty(start));
        }
        writer.write_event(Event::Start(start))?;
        for child in &self.children {
            child.write(writer)?;
        }
        writer.write_event(Event::End(BytesEnd::new(self.name)))
    }
}
