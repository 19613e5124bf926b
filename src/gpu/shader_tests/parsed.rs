//! A shader as naga has parsed and validated it.

use crate::gpu::shader::ExpandedShader;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{GlobalVariable, Handle, Span};

/// A shader that is valid core WebGPU, or WebGPU with subgroups if `_subgroups` ends its entry point.
pub(super) struct Parsed {
    pub module: naga::Module,
    pub info: ModuleInfo,
    pub layouter: naga::proc::Layouter,
    pub expanded: ExpandedShader,
}

impl Parsed {
    pub fn new(expanded: ExpandedShader) -> Result<Self, String> {
        let text = &expanded.text;
        let place = |line: Option<u32>| expanded.origin(line.unwrap_or(1));
        let module = naga::front::wgsl::parse_str(text).map_err(|e| {
            format!("{}: {}", place(e.location(text).map(|l| l.line_number)), e.emit_to_string(text))
        })?;
        let needs_subgroups = module.entry_points.iter().any(|e| e.name.ends_with("_subgroups"));
        let capabilities = if needs_subgroups { Capabilities::SUBGROUP } else { Capabilities::empty() };
        let info = Validator::new(ValidationFlags::all(), capabilities).validate(&module).map_err(|e| {
            format!("{}: {}", place(e.location(text).map(|l| l.line_number)), e.emit_to_string(text))
        })?;
        let mut layouter = naga::proc::Layouter::default();
        layouter.update(module.to_ctx()).map_err(|e| e.to_string())?;
        Ok(Self { module, info, layouter, expanded })
    }

    /// File and line of a span.
    pub fn at(&self, span: Span) -> String {
        self.expanded.origin(span.location(&self.expanded.text).line_number)
    }

    /// File and line of a member of a structure.
    pub fn member_at(&self, ty: Handle<naga::Type>, name: &str) -> String {
        let span = self.module.types.get_span(ty);
        let text = span.to_range().map_or("", |range| &self.expanded.text[range]);
        let before = text.find(&format!(" {name}:")).map_or(0, |at| text[..at].matches('\n').count());
        self.expanded.origin(span.location(&self.expanded.text).line_number + before as u32)
    }

    pub fn variable_at(&self, handle: Handle<GlobalVariable>) -> String {
        self.at(self.module.global_variables.get_span(handle))
    }

    pub fn is_used(&self, handle: Handle<GlobalVariable>) -> bool {
        !self.info.get_entry_point(0)[handle].is_empty()
    }
}
