//! The part of ONNX's protocol buffers that a network without control flow needs (onnx.proto3 of ONNX 1.16: names and field numbers).

/// ModelProto
#[derive(Clone, PartialEq, prost::Message)]
pub struct Model {
    #[prost(int64, tag = "1")]
    pub ir_version: i64,
    #[prost(string, tag = "2")]
    pub producer_name: String,
    #[prost(string, tag = "3")]
    pub producer_version: String,
    #[prost(message, optional, tag = "7")]
    pub graph: Option<Graph>,
    #[prost(message, repeated, tag = "8")]
    pub opset_import: Vec<OperatorSet>,
    #[prost(message, repeated, tag = "14")]
    pub metadata_props: Vec<MetadataEntry>,
}

/// StringStringEntryProto
#[derive(Clone, PartialEq, prost::Message)]
pub struct MetadataEntry {
    #[prost(string, tag = "1")]
    pub key: String,
    #[prost(string, tag = "2")]
    pub value: String,
}

/// OperatorSetIdProto
#[derive(Clone, PartialEq, prost::Message)]
pub struct OperatorSet {
    #[prost(string, tag = "1")]
    pub domain: String,
    #[prost(int64, tag = "2")]
    pub version: i64,
}

/// GraphProto
#[derive(Clone, PartialEq, prost::Message)]
pub struct Graph {
    #[prost(message, repeated, tag = "1")]
    pub node: Vec<Node>,
    #[prost(string, tag = "2")]
    pub name: String,
    #[prost(message, repeated, tag = "5")]
    pub initializer: Vec<Tensor>,
    #[prost(message, repeated, tag = "11")]
    pub input: Vec<Value>,
    #[prost(message, repeated, tag = "12")]
    pub output: Vec<Value>,
}

/// NodeProto
#[derive(Clone, PartialEq, prost::Message)]
pub struct Node {
    #[prost(string, repeated, tag = "1")]
    pub input: Vec<String>,
    #[prost(string, repeated, tag = "2")]
    pub output: Vec<String>,
    #[prost(string, tag = "3")]
    pub name: String,
    #[prost(string, tag = "4")]
    pub op_type: String,
    #[prost(message, repeated, tag = "5")]
    pub attribute: Vec<Attribute>,
}

/// AttributeProto
#[derive(Clone, PartialEq, prost::Message)]
pub struct Attribute {
    #[prost(string, tag = "1")]
    pub name: String,
    #[prost(int64, tag = "3")]
    pub i: i64,
    #[prost(int64, repeated, tag = "8")]
    pub ints: Vec<i64>,
    /// 2 for one integer, 7 for several
    #[prost(int32, tag = "20")]
    pub kind: i32,
}

impl Attribute {
    pub fn int(name: &str, value: usize) -> Self {
        Self {
            name: name.into(),
            i: value as i64,
            kind: 2,
            ..Self::default()
        }
    }

    pub fn ints(name: &str, values: &[usize]) -> Self {
        Self {
            name: name.into(),
            ints: values.iter().map(|&value| value as i64).collect(),
            kind: 7,
            ..Self::default()
        }
    }
}

/// f32 in TensorProto and TypeProto
const FLOAT: i32 = 1;

/// TensorProto
#[derive(Clone, PartialEq, prost::Message)]
pub struct Tensor {
    #[prost(int64, repeated, tag = "1")]
    pub dims: Vec<i64>,
    #[prost(int32, tag = "2")]
    pub data_type: i32,
    #[prost(string, tag = "8")]
    pub name: String,
    /// little endian
    #[prost(bytes = "vec", tag = "9")]
    pub raw_data: Vec<u8>,
}

impl Tensor {
    pub fn of_floats(name: &str, shape: &[usize], values: &[f32]) -> Self {
        Self {
            dims: shape.iter().map(|&side| side as i64).collect(),
            data_type: FLOAT,
            name: name.into(),
            raw_data: values
                .iter()
                .flat_map(|value| value.to_le_bytes())
                .collect(),
        }
    }
}

/// ValueInfoProto
#[derive(Clone, PartialEq, prost::Message)]
pub struct Value {
    #[prost(string, tag = "1")]
    pub name: String,
    #[prost(message, optional, tag = "2")]
    pub kind: Option<Type>,
}

impl Value {
    /// Describes a tensor of f32; dimensions of `None` may have any size.
    pub fn of_floats(name: &str, shape: &[Option<i64>]) -> Self {
        let dim = shape.iter().enumerate().map(|(index, side)| match side {
            Some(side) => Dimension {
                value: Some(dimension::Value::Fixed(*side)),
            },
            // The first dimension is the number of images, the same in input and output.
            None if index == 0 => Dimension {
                value: Some(dimension::Value::Named("N".into())),
            },
            None => Dimension {
                value: Some(dimension::Value::Named(format!("{name}_side{index}"))),
            },
        });
        let shape = Shape { dim: dim.collect() };
        Self {
            name: name.into(),
            kind: Some(Type {
                tensor: Some(TensorType {
                    elem_type: FLOAT,
                    shape: Some(shape),
                }),
            }),
        }
    }
}

/// TypeProto
#[derive(Clone, PartialEq, prost::Message)]
pub struct Type {
    #[prost(message, optional, tag = "1")]
    pub tensor: Option<TensorType>,
}

/// TypeProto.Tensor
#[derive(Clone, PartialEq, prost::Message)]
pub struct TensorType {
    #[prost(int32, tag = "1")]
    pub elem_type: i32,
    #[prost(message, optional, tag = "2")]
    pub shape: Option<Shape>,
}

/// TensorShapeProto
#[derive(Clone, PartialEq, prost::Message)]
pub struct Shape {
    #[prost(message, repeated, tag = "1")]
    pub dim: Vec<Dimension>,
}

/// TensorShapeProto.Dimension
#[derive(Clone, PartialEq, prost::Message)]
pub struct Dimension {
    #[prost(oneof = "dimension::Value", tags = "1, 2")]
    pub value: Option<dimension::Value>,
}

/// The choice in a dimension.
pub mod dimension {
    /// One dimension of a tensor.
    #[derive(Clone, PartialEq, prost::Oneof)]
    pub enum Value {
        /// dim_value
        #[prost(int64, tag = "1")]
        Fixed(i64),
        /// dim_param
        #[prost(string, tag = "2")]
        Named(String),
    }
}
