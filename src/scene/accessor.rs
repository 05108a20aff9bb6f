//! Reads accessors: strided, sparse, normalized, each offset and length checked first.
//!
//! Reference: glTF 2.0 specification, section 3.6 "Binary Data Storage"; `KHR_mesh_quantization`.

use super::document::{self, Document, follow};
use super::source::view_bytes;
use super::{ImportError, Item};

/// An accessor without a buffer view is all zeros, so its length is just a number in the file.
const MOST_ZEROS: u64 = 1 << 24;

/// Why an accessor cannot be read. Reads on after the accessor's name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum AccessorFault {
    /// The `type` does not suit the use.
    #[error("is {found}, and {role} must be {expected}; export the mesh again")]
    Shape {
        /// The type found.
        found: String,
        /// What it is read as.
        role: &'static str,
        /// What it may be.
        expected: String,
    },

    /// The `componentType` does not suit the use.
    #[error("has component type {found}, which {role} cannot have; export the mesh again")]
    Component {
        /// The code found.
        found: u64,
        /// What it is read as.
        role: &'static str,
    },

    /// Elements would overlap.
    #[error("has elements of {size} bytes at a stride of {stride}; export the file again")]
    Stride {
        /// Bytes of an element.
        size: u64,
        /// Bytes from one to the next.
        stride: u64,
    },

    /// The elements reach beyond the buffer view.
    #[error("ends at byte {end} of bufferView {view}, which has {length} bytes; export the file again")]
    OutsideView {
        /// Where the last element would end.
        end: u128,
        /// The buffer view.
        view: usize,
        /// The view's length.
        length: usize,
    },

    /// Absurdly many elements without data.
    #[error("has {count} elements but no bufferView, and at most {MOST_ZEROS} are read so; export it again")]
    TooManyZeros {
        /// The count.
        count: u64,
    },

    /// More sparse values than elements.
    #[error("replaces {sparse} of {count} elements by sparse values; export the file again")]
    SparseCount {
        /// The sparse count.
        sparse: u64,
        /// The accessor's count.
        count: u64,
    },

    /// A sparse index beyond the last element.
    #[error("has a sparse value for element {index} of {count}; export the file again")]
    SparseIndex {
        /// The index.
        index: u64,
        /// The accessor's count.
        count: u64,
    },
}

/// What an accessor is read as, and so what it may hold.
#[derive(Debug)]
pub(super) struct Role {
    /// In messages: `POSITION`, `vertex indices` …
    pub(super) name: &'static str,
    shapes: &'static [Shape],
    components: &'static [Component],
}

impl Role {
    pub(super) const INDICES: Self = Self {
        name: "vertex indices",
        shapes: &[Shape::Scalar],
        components: &[Component::U8, Component::U16, Component::U32],
    };
    pub(super) const POSITION: Self =
        Self { name: "POSITION", shapes: &[Shape::Vec3], components: Component::QUANTIZED };
    pub(super) const NORMAL: Self =
        Self { name: "NORMAL", shapes: &[Shape::Vec3], components: Component::QUANTIZED };
    pub(super) const TEXCOORD: Self =
        Self { name: "TEXCOORD", shapes: &[Shape::Vec2], components: Component::QUANTIZED };
    pub(super) const COLOR: Self =
        Self { name: "COLOR_0", shapes: &[Shape::Vec3, Shape::Vec4], components: Component::QUANTIZED };
    pub(super) const JOINTS: Self =
        Self { name: "JOINTS", shapes: &[Shape::Vec4], components: &[Component::U8, Component::U16] };
    pub(super) const WEIGHTS: Self =
        Self { name: "WEIGHTS", shapes: &[Shape::Vec4], components: Component::QUANTIZED };
    pub(super) const TRANSLATION: Self =
        Self { name: "TRANSLATION", shapes: &[Shape::Vec3], components: &[Component::F32] };
    pub(super) const ROTATION: Self = Self {
        name: "ROTATION",
        shapes: &[Shape::Vec4],
        components: &[Component::F32, Component::I8, Component::I16],
    };
    pub(super) const SCALE: Self =
        Self { name: "SCALE", shapes: &[Shape::Vec3], components: &[Component::F32] };
    pub(super) const MATRICES: Self =
        Self { name: "inverse bind matrices", shapes: &[Shape::Mat4], components: &[Component::F32] };
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shape {
    Scalar,
    Vec2,
    Vec3,
    Vec4,
    Mat4,
}

impl Shape {
    fn name(self) -> &'static str {
        match self {
            Self::Scalar => "SCALAR",
            Self::Vec2 => "VEC2",
            Self::Vec3 => "VEC3",
            Self::Vec4 => "VEC4",
            Self::Mat4 => "MAT4",
        }
    }

    fn width(self) -> usize {
        match self {
            Self::Scalar => 1,
            Self::Vec2 => 2,
            Self::Vec3 => 3,
            Self::Vec4 => 4,
            Self::Mat4 => 16,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    /// What `KHR_mesh_quantization` allows beside floats.
    const QUANTIZED: &'static [Self] = &[Self::F32, Self::I8, Self::U8, Self::I16, Self::U16];

    fn from_code(code: u64) -> Option<Self> {
        match code {
            5120 => Some(Self::I8),
            5121 => Some(Self::U8),
            5122 => Some(Self::I16),
            5123 => Some(Self::U16),
            5125 => Some(Self::U32),
            5126 => Some(Self::F32),
            _ => None,
        }
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The number at the start of `bytes`, as stored.
    fn read(self, bytes: &[u8]) -> Option<f64> {
        Some(match self {
            Self::I8 => i8::from_le_bytes(*bytes.first_chunk()?).into(),
            Self::U8 => (*bytes.first()?).into(),
            Self::I16 => i16::from_le_bytes(*bytes.first_chunk()?).into(),
            Self::U16 => u16::from_le_bytes(*bytes.first_chunk()?).into(),
            Self::U32 => u32::from_le_bytes(*bytes.first_chunk()?).into(),
            Self::F32 => f32::from_le_bytes(*bytes.first_chunk()?).into(),
        })
    }

    /// A stored number as the fraction that `normalized` makes of it.
    fn normalize(self, stored: f64) -> f64 {
        match self {
            Self::I8 => (stored / 127.0).max(-1.0),
            Self::U8 => stored / 255.0,
            Self::I16 => (stored / 32767.0).max(-1.0),
            Self::U16 => stored / 65535.0,
            Self::U32 | Self::F32 => stored,
        }
    }
}

/// An accessor's numbers, element after element.
#[derive(Debug, PartialEq)]
pub(super) struct Numbers {
    values: Vec<f64>,
    width: usize,
}

impl Numbers {
    /// How many elements there are.
    pub(super) fn len(&self) -> usize {
        self.values.len() / self.width
    }

    /// Components of an element.
    pub(super) fn components(&self) -> usize {
        self.width
    }

    /// The elements as arrays of their first `N` components; missing components read as zero.
    pub(super) fn arrays<const N: usize>(&self) -> impl Iterator<Item = [f64; N]> {
        self.values
            .chunks_exact(self.width)
            .map(|element| std::array::from_fn(|k| element.get(k).copied().unwrap_or(0.0)))
    }
}

/// A document with its buffers, to read accessors from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Accessors<'a> {
    pub(super) document: &'a Document,
    pub(super) buffers: &'a [Vec<u8>],
}

/// Where elements lie in a buffer view.
#[derive(Clone, Copy)]
struct Layout {
    view: usize,
    offset: u64,
    /// `None`: tightly packed.
    stride: Option<u64>,
    count: u64,
    width: usize,
    component: Component,
}

impl Accessors<'_> {
    /// Reads accessor `index`, to which `from` refers.
    ///
    /// # Errors
    /// Names the accessor (or what it refers to) if it does not suit `role`, reaches beyond its
    /// buffer view, or has an absurd count.
    pub(super) fn read(
        &self,
        index: usize,
        role: &Role,
        from: impl FnOnce() -> Item,
    ) -> Result<Numbers, ImportError> {
        let accessor = follow(&self.document.accessors, index, "accessor", from)?;
        let item = || Item::new("accessor", index, accessor.name.as_deref());
        let refuse = |fault| ImportError::Accessor { accessor: item(), fault };

        let shape = role.shapes.iter().find(|shape| shape.name() == accessor.shape).ok_or_else(|| {
            let expected: Vec<_> = role.shapes.iter().map(|shape| shape.name()).collect();
            let found = super::item::shown(&accessor.shape);
            refuse(AccessorFault::Shape { found, role: role.name, expected: expected.join(" or ") })
        })?;
        let component = Component::from_code(accessor.component_type)
            .filter(|component| role.components.contains(component))
            .ok_or_else(|| {
                refuse(AccessorFault::Component { found: accessor.component_type, role: role.name })
            })?;
        let width = shape.width();

        let mut values = match accessor.buffer_view {
            Some(view) => {
                let stride = self.document.views.get(view).and_then(|view| view.byte_stride);
                let (offset, count) = (accessor.byte_offset, accessor.count);
                self.numbers(Layout { view, offset, stride, count, width, component }, &item)?
            }
            None if accessor.count > MOST_ZEROS => {
                return Err(refuse(AccessorFault::TooManyZeros { count: accessor.count }));
            }
            None => vec![0.0; accessor.count as usize * width],
        };
        if let Some(sparse) = &accessor.sparse {
            self.overwrite(&mut values, sparse, (width, component), &item)?;
        }
        if accessor.normalized && role.name != Role::INDICES.name {
            values.iter_mut().for_each(|value| *value = component.normalize(*value));
        }
        Ok(Numbers { values, width })
    }

    /// Puts the sparse values in their places.
    fn overwrite(
        &self,
        values: &mut [f64],
        sparse: &document::Sparse,
        (width, component): (usize, Component),
        item: &impl Fn() -> Item,
    ) -> Result<(), ImportError> {
        let refuse = |fault| ImportError::Accessor { accessor: item(), fault };
        let count = (values.len() / width) as u64;
        if sparse.count > count {
            return Err(refuse(AccessorFault::SparseCount { sparse: sparse.count, count }));
        }
        let code = sparse.indices.component_type;
        let role = "sparse indices";
        let index_component = Component::from_code(code)
            .filter(|component| Role::INDICES.components.contains(component))
            .ok_or_else(|| refuse(AccessorFault::Component { found: code, role }))?;
        let indices = Layout {
            view: sparse.indices.buffer_view,
            offset: sparse.indices.byte_offset,
            stride: None,
            count: sparse.count,
            width: 1,
            component: index_component,
        };
        let (view, offset) = (sparse.values.buffer_view, sparse.values.byte_offset);
        let replacements = Layout { view, offset, width, component, ..indices };
        let indices = self.numbers(indices, item)?;
        let replacements = self.numbers(replacements, item)?;
        for (index, replacement) in indices.into_iter().zip(replacements.chunks_exact(width)) {
            let start = index as usize * width;
            values
                .get_mut(start..start + width)
                .ok_or_else(|| refuse(AccessorFault::SparseIndex { index: index as u64, count }))?
                .copy_from_slice(replacement);
        }
        Ok(())
    }

    /// Reads what `layout` describes, after checking that it lies inside its buffer view.
    fn numbers(&self, layout: Layout, item: &impl Fn() -> Item) -> Result<Vec<f64>, ImportError> {
        let bytes = view_bytes(self.document, self.buffers, layout.view, item)?;
        let refuse = |fault| ImportError::Accessor { accessor: item(), fault };
        let component_size = layout.component.size();
        let size = (component_size * layout.width) as u64;
        let stride = layout.stride.unwrap_or(size);
        if stride < size {
            return Err(refuse(AccessorFault::Stride { size, stride }));
        }
        let Some(last) = layout.count.checked_sub(1) else { return Ok(Vec::new()) };
        let end = u128::from(layout.offset) + u128::from(last) * u128::from(stride) + u128::from(size);
        if end > bytes.len() as u128 {
            return Err(refuse(AccessorFault::OutsideView { end, view: layout.view, length: bytes.len() }));
        }
        // From here every product fits: each element lies inside `bytes`.
        let mut values = Vec::with_capacity(layout.count as usize * layout.width);
        for element in bytes.get(layout.offset as usize..).unwrap_or_default().chunks(stride as usize) {
            if values.len() == layout.count as usize * layout.width {
                break;
            }
            let components = element.chunks(component_size).take(layout.width);
            values.extend(components.filter_map(|bytes| layout.component.read(bytes)));
        }
        Ok(values)
    }
}
