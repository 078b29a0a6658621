# The format for Kaitai Struct: header, section table, the record of each section, and stored bodies. Bodies in the codecs
# zstd and adaptive are bytes. Checksums, limits and most rules on values are not checked: v1.md has them. The `doc-ref` of
# a type holds for its fields.
meta:
  id: strivec
  title: Strivec scene, version 1
  application: Strivec
  file-extension: strivec
  license: MIT OR Apache-2.0
  ks-version: '0.10'
  encoding: UTF-8
  endian: le
doc: One scene, a sparse tri-vector radiance field
doc-ref: v1.md#2-the-file

seq:
  - id: header
    type: header
    doc: First 64 bytes
  - id: table
    type: 'entry(_index, _index == 0 ? 0 : table[_index - 1].scale_index)'
    repeat: expr
    repeat-expr: header.section_count
    doc: Section table; the payloads are those of its entries

enums:
  codec: {0: stored, 1: zstd, 2: adaptive}
  up: {0: plus_x, 1: plus_y, 2: plus_z, 3: minus_x, 4: minus_y, 5: minus_z}
  color_space: {0: srgb}
  coverage: {0: all, 1: any}
  aggregation: {0: normalized, 1: clamped}
  reduction: {0: sum, 1: mean}
  contraction: {0: none, 1: l_infinity}
  encoding: {0: f32, 1: f16, 2: grid}
  filter: {0: none, 1: planes}
  decoder_mode: {0: per_sample, 1: per_ray, 2: residual}
  factor_kind: {0: cp, 1: vm}
  placement_kind: {0: lattice, 1: explicit}
  components: {0: all, 1: listed}
  thumbnail_format: {0: png, 1: jpeg}
  projection: {0: perspective, 1: fisheye, 2: equirectangular}

types:
  header:
    doc-ref: v1.md#21-header
    seq:
      - {id: magic, contents: [0xb3, 'STV', 0x0d, 0x0a, 0x1a, 0x0a], doc: Magic}
      - {id: major, type: u2, valid: 1, doc: Major version}
      - {id: minor, type: u2, doc: Minor version}
      - {id: section_count, type: u4, doc: Number of sections n}
      - {id: file_length, type: u8, doc: Length of the whole file in bytes}
      - {id: table_checksum, type: u4, doc: CRC-32 of the section table}
      - {id: file_checksum, type: u4, doc: CRC-32 of bytes 64 to the end of the file}
      - {id: reserved, size: 28, doc: Zeros in version 1.0}
      - {id: header_checksum, type: u4, doc: CRC-32 of bytes 0 to 60}

  entry:
    doc: An entry of the section table, 64 bytes, and the payload that it names
    doc-ref: v1.md#22-section-table
    params:
      - {id: index, type: s4, doc: Number of this entry from 0}
      - {id: scale_index_before, type: s4, doc: The previous entry's scale_index}
    seq:
      - {id: kind, type: str, size: 12, encoding: ASCII, pad-right: 0, doc: Kind of the section}
      - {id: flags, type: u2, doc: Bit 0 is 1 for a critical section; other bits are reserved}
      - {id: scale, type: u2, doc: Scale of the section; 0xffff for none}
      - {id: chunk, type: u4, doc: Chunk of that scale; 0xffffffff for none}
      - {id: codec, type: u2, enum: codec, doc: Compression of the body}
      - {id: reserved_2, size: 2, doc: Zeros in version 1.0}
      - {id: checksum, type: u4, doc: CRC-32 of the payload as it is in the file}
      - {id: reserved_4, size: 4, doc: Zeros in version 1.0}
      - {id: offset, type: u8, doc: Offset of the payload in the file}
      - {id: length, type: u8, doc: Length of the payload in the file}
      - {id: decoded_length, type: u8, doc: Length of the payload once its body is decoded}
      - {id: reserved_8, size: 8, doc: Zeros in version 1.0}
    instances:
      is_critical:
        value: flags & 1 == 1
        doc: A reader that does not know a critical section refuses the file
      is_stored:
        value: codec == codec::stored
        doc: The body is not compressed
      scale_index:
        value: 'kind == "SCALE" ? index : scale_index_before'
        doc: Entry of the SCALE that this entry belongs to, or 0 before the first
      scale_record:
        value: _root.table[scale_index].payload.as<scale>
        doc: That SCALE; undefined for sections before the first
      payload:
        io: _root._io
        pos: offset
        size: length
        doc: Record and body; bytes if version 1.0 does not define the kind
        type:
          switch-on: kind
          cases:
            '"FRAME"': frame
            '"RULES"': rules
            '"PROVENANCE"': provenance
            '"LICENCE"': string
            '"QUALITY"': quality
            '"VIEWS"': views
            '"THUMBNAIL"': thumbnail
            '"DECODER"': decoder
            '"OCCUPANCY"': occupancy
            '"SCALE"': scale
            '"MATRIX"': matrix
            '"PLACEMENT"': placement
            '"DENSITY"': factors
            '"APPEARANCE"': factors
            '"PREFIX"': prefix
            '"PROBES"': probes
            '"CAMERAS"': cameras
            '"NOTES"': notes

  string:
    doc: Text with its length; also the whole payload of LICENCE (3.15)
    doc-ref: v1.md#1-conventions
    seq:
      - {id: length, type: u8, doc: Number of bytes}
      - {id: text, type: str, size: length, doc: UTF-8 without terminator}
  vec3:
    doc: A position, a direction or a size
    doc-ref: v1.md#1-conventions
    seq:
      - {id: x, type: f8, doc: Along x}
      - {id: y, type: f8, doc: Along y}
      - {id: z, type: f8, doc: Along z}
  counts3:
    doc: Three counts, one for each axis
    doc-ref: v1.md#1-conventions
    seq:
      - {id: x, type: u4, doc: Along x}
      - {id: y, type: u4, doc: Along y}
      - {id: z, type: u4, doc: Along z}
  quaternion:
    doc: A rotation; its length is 1 within 1e-6
    doc-ref: v1.md#31-frame
    seq:
      - {id: x, type: f8, doc: Imaginary part x}
      - {id: y, type: f8, doc: Imaginary part y}
      - {id: z, type: f8, doc: Imaginary part z}
      - {id: w, type: f8, doc: Real part}
  pose:
    doc: Position and rotation of a camera, 56 bytes
    doc-ref: v1.md#313-views
    seq:
      - {id: position, type: vec3, doc: Position in model space}
      - {id: rotation, type: quaternion, doc: From the camera's axes to those of model space}
  zeros:
    doc: Bytes between a record and its body
    doc-ref: v1.md#22-section-table
    seq:
      - {id: bytes, type: u1, repeat: eos, valid: 0, doc: Zeros}

  frame:
    doc-ref: v1.md#31-frame
    seq:
      - {id: scale, type: f8, doc: Scale s of the map from dataset space to model space}
      - {id: rotation, type: quaternion, doc: Rotation q of the map}
      - {id: translation, type: vec3, doc: Translation t of the map}
      - {id: meters_per_unit, type: f8, doc: Meters per unit of dataset space; 0 if unknown}
      - {id: near, type: f8, doc: Where rays begin in model units from the camera}
      - {id: far, type: f8, doc: Where rays end}
      - {id: background, type: f4, repeat: expr, repeat-expr: 3, doc: 'Red, green, blue'}
      - {id: up, type: u1, enum: up, doc: Up in dataset space}
      - {id: color_space, type: u1, enum: color_space, doc: Color space of the colors}

  rules:
    doc-ref: v1.md#32-rules
    seq:
      - {id: scale_count, type: u2, doc: Number of scales}
      - {id: coverage, type: u1, enum: coverage, doc: Scales that must cover a point of the model}
      - {id: aggregation, type: u1, enum: aggregation, doc: Weights of the neighbors}
      - {id: density_reduction, type: u1, enum: reduction, doc: Density feature of several scales}
      - {id: appearance_reduction, type: u1, enum: reduction, doc: Appearance features of several scales}
      - {id: contraction, type: u1, enum: contraction, doc: Contraction of unbounded space}
      - {id: sky_degree, type: u1, doc: 'Degree L of the sky, 1 to 4; 0 for none'}
      - {id: min_corner, type: vec3, doc: Minimum corner of the bounds}
      - {id: max_corner, type: vec3, doc: Maximum corner of the bounds}
      - {id: density_shift, type: f8, doc: Added to the density feature}
      - {id: distance_scale, type: f8, doc: Factor of the step in the opacity}
      - {id: step, type: f8, doc: Step δ between samples}
      - {id: min_transmittance, type: f8, doc: A march ends below it}
      - {id: min_weight, type: f8, doc: Samples of at most this visibility weight are not shaded}
      - {id: shell, type: f8, doc: Shell b of the contraction; 0 without one}
      - id: sky
        type: f4
        repeat: expr
        repeat-expr: 3 * (sky_degree + 1) * (sky_degree + 1)
        if: sky_degree > 0
        doc: 'Coefficients of the sky: all of red, then green, then blue'

  array_head:
    doc: How the numbers of an array are encoded, 4 bytes
    doc-ref: v1.md#33-arrays-of-numbers
    seq:
      - {id: encoding, type: u1, enum: encoding, doc: Encoding}
      - {id: bits, type: u1, doc: Bits b of the integers of a grid; 0 for other encodings}
      - {id: filter, type: u1, enum: filter, doc: Filter}
      - {id: reserved, type: u1, doc: Zero in version 1.0}
    instances:
      integer_bytes:
        value: 'bits > 8 ? 2 : 1'
        doc: Bytes of an integer of a grid
  array:
    doc: A stored array, in one of five forms
    doc-ref: v1.md#33-arrays-of-numbers
    params:
      - {id: head, type: array_head, doc: Its head}
      - {id: groups, type: u4, doc: Number of groups}
    seq:
      - {id: f32, type: f4, repeat: eos, if: 'head.encoding == encoding::f32 and head.filter == filter::none',
         doc: Numbers}
      - id: f16
        type: u2
        repeat: eos
        if: head.encoding == encoding::f16 and head.filter == filter::none
        doc: Bits of binary16 numbers
      - {id: planes, size-eos: true, if: 'head.filter == filter::planes',
         doc: 'All first bytes, all second bytes, and so on'}
      - {id: step_codes, type: u1, repeat: expr, repeat-expr: groups, if: 'head.encoding == encoding::grid',
         doc: Step codes}
      - id: integers
        type:
          switch-on: head.integer_bytes
          cases: {1: s1, 2: s2}
        repeat: eos
        if: head.encoding == encoding::grid
        doc: Integers q; each number is its q times the step of its group

  provenance:
    doc-ref: v1.md#34-provenance
    seq:
      - {id: steps, type: u8, doc: Training steps}
      - {id: seed, type: u8, doc: Random seed}
      - {id: dataset, type: string, doc: Dataset}
      - {id: preset, type: string, doc: Preset}
      - {id: tool, type: string, doc: Tool and its version}

  decoder:
    doc-ref: v1.md#35-decoder
    seq:
      - {id: mode, type: u1, enum: decoder_mode, doc: How often the network is called}
      - {id: feature_frequencies, type: u4, doc: Frequencies K_f of the features' positional encoding}
      - {id: direction_frequencies, type: u4, doc: Frequencies K_d of the direction's positional encoding}
      - {id: layer_count, type: u8, doc: Number of layers L}
      - id: layers
        type: 'layer(_index == 0 ? 0 : layers[_index - 1].groups)'
        repeat: expr
        repeat-expr: layer_count
        doc: Widths of the layers
      - {id: head, type: array_head, doc: Encoding of the body}
      - {id: padding, type: zeros, size: -_io.pos % 64, doc: Zeros up to the body}
      - {id: body, type: 'array(head, layers.last.groups)', size-eos: true, if: _parent.is_stored,
         doc: 'Weights, bias, layer by layer'}
      - {id: encoded, size-eos: true, if: not _parent.is_stored, doc: Body in the codec of the entry}
  layer:
    doc-ref: v1.md#35-decoder
    params:
      - {id: groups_before, type: u4, doc: Groups of the layers before}
    seq:
      - {id: inputs, type: u4, doc: Inputs}
      - {id: outputs, type: u4, doc: Outputs}
    instances:
      groups:
        value: groups_before + outputs + 1
        doc: Groups up to this layer, a row for each output and a bias

  occupancy:
    doc-ref: v1.md#36-occupancy
    seq:
      - {id: min_corner, type: vec3, doc: Minimum corner of the grid}
      - {id: max_corner, type: vec3, doc: Maximum corner of the grid}
      - {id: vertices, type: counts3, doc: Vertices along each axis}
      - {id: padding, type: zeros, size: -_io.pos % 64, doc: Zeros up to the body}
      - {id: bits, size-eos: true, if: _parent.is_stored,
         doc: 'A bit for each vertex, x fastest, least significant bit first'}
      - {id: encoded, size-eos: true, if: not _parent.is_stored, doc: Body in the codec of the entry}

  scale:
    doc-ref: v1.md#37-scale
    seq:
      - {id: tensor_count, type: u4, doc: Number of tensors N}
      - {id: top_k, type: u4, doc: Largest number of neighbors of a point}
      - {id: half_edges, type: vec3, doc: Half edges h of the tensors}
      - {id: resolution, type: counts3, doc: 'Resolution D: cells along each axis'}
      - {id: factor_kind, type: u1, enum: factor_kind, doc: Form of a component}
      - {id: placement, type: u1, enum: placement_kind, doc: Form of PLACEMENT}
      - {id: reserved_2, size: 2, doc: Zeros in version 1.0}
      - {id: density_rank, type: u4, doc: Density rank}
      - {id: appearance_rank, type: u4, doc: Appearance rank R}
      - {id: chunk_count, type: u4, doc: Number of chunks C}
      - {id: reserved_4, size: 4, doc: Zeros in version 1.0}
      - {id: origin, type: vec3, doc: 'Lattice: minimum corner of cell (0, 0, 0)'}
      - {id: pitch, type: vec3, doc: 'Lattice: edge lengths of a cell'}
      - {id: extent, type: counts3, doc: 'Lattice: one more than the largest coordinate of an occupied cell'}
      - {id: density_axis_ranks, type: counts3, if: factor_kind == factor_kind::vm,
         doc: Density components whose vectors lie along each axis}
      - {id: appearance_axis_ranks, type: counts3, if: factor_kind == factor_kind::vm,
         doc: Appearance components whose vectors lie along each axis}
      - {id: padding, type: zeros, size: -_io.pos % 64, doc: Zeros up to the body}
      - {id: chunks, type: chunk, repeat: expr, repeat-expr: chunk_count, if: _parent.is_stored, doc: Chunks}
      - {id: encoded, size-eos: true, if: not _parent.is_stored, doc: Body in the codec of the entry}
    instances:
      group_length:
        value: resolution.x + resolution.y + resolution.z + 3
        doc: Numbers of a component of kind cp, those of its three vectors
  chunk:
    doc-ref: v1.md#37-scale
    seq:
      - {id: tensor_count, type: u4, doc: Number of its tensors}
      - {id: min_corner, type: vec3, doc: Minimum corner of the box that they cover}
      - {id: max_corner, type: vec3, doc: Maximum corner of the box}

  matrix:
    doc-ref: v1.md#38-matrix
    seq:
      - {id: features, type: u4, doc: Features P}
      - {id: rank, type: u4, doc: Appearance rank R of the scale}
      - {id: head, type: array_head, doc: Encoding of the body}
      - {id: padding, type: zeros, size: -_io.pos % 64, doc: Zeros up to the body}
      - {id: body, type: 'array(head, features)', size-eos: true, if: _parent.is_stored, doc: 'Matrix [P][R]'}
      - {id: encoded, size-eos: true, if: not _parent.is_stored, doc: Body in the codec of the entry}

  placement:
    doc: Centers of a chunk's tensors, in one of two forms
    doc-ref: v1.md#39-placement
    seq:
      - id: gaps
        type: leb128
        repeat: eos
        if: _parent.is_stored and _parent.scale_record.placement == placement_kind::lattice
        doc: First cell, then each cell minus the previous one minus 1
      - id: centers
        type: vec3
        repeat: eos
        if: _parent.is_stored and _parent.scale_record.placement == placement_kind::explicit
        doc: Centers
      - {id: encoded, size-eos: true, if: not _parent.is_stored, doc: Body in the codec of the entry}
  leb128:
    doc: An integer of 1 to 9 bytes
    doc-ref: v1.md#39-placement
    seq:
      - {id: bytes, type: u1, repeat: until, repeat-until: _ < 128, doc: 'Groups of 7 bits, the least significant first'}
    instances:
      value:
        value: >-
          (bytes[0] & 127) + (bytes.size > 1 ? (bytes[1] & 127) * 128 : 0)
          + (bytes.size > 2 ? (bytes[2] & 127) * 16384 : 0) + (bytes.size > 3 ? (bytes[3] & 127) * 2097152 : 0)
          + (bytes.size > 4 ? (bytes[4] & 127) * 268435456 : 0) + (bytes.size > 5 ? (bytes[5] & 127) * 34359738368 : 0)
          + (bytes.size > 6 ? (bytes[6] & 127) * 4398046511104 : 0)
          + (bytes.size > 7 ? (bytes[7] & 127) * 562949953421312 : 0)
          + (bytes.size > 8 ? (bytes[8] & 127) * 72057594037927936 : 0)
        doc: The integer

  factors:
    doc: DENSITY or APPEARANCE of a chunk
    doc-ref: v1.md#310-density-and-appearance
    seq:
      - {id: components, type: u1, enum: components, doc: Components that are stored}
      - {id: reserved, size: 7, doc: Zeros in version 1.0}
      - {id: head, type: array_head, doc: Encoding of the body}
      - {id: padding, type: zeros, size: -_io.pos % 64, doc: Zeros up to the body}
      - id: masks
        size: mask_bytes
        repeat: expr
        repeat-expr: mask_count
        if: has_numbers
        doc: For each tensor, a bit for each component that is stored
      - id: numbers
        type: array(head, group_count)
        size-eos: true
        if: has_numbers
        doc: Components that are stored, tensor after tensor
      - {id: encoded, size-eos: true, if: not has_numbers,
         doc: 'Body in the codec of the entry, or after a compressed SCALE, or of kind vm'}
    instances:
      has_numbers:
        value: >-
          _parent.is_stored and _parent.scale_record.factor_kind == factor_kind::cp
          and (components == components::all or _root.table[_parent.scale_index].is_stored)
        doc: The body is stored, and the numbers of its masks and of each group are known
      rank:
        value: '_parent.kind == "DENSITY" ? _parent.scale_record.density_rank : _parent.scale_record.appearance_rank'
        doc: Components that a tensor can have
      mask_bytes:
        value: (rank + 7) / 8
        doc: Bytes of a mask
      mask_count:
        value: 'components == components::all ? 0 : _parent.scale_record.chunks[_parent.chunk].tensor_count'
        doc: Number of masks, one for each tensor if components are listed
      group_count:
        value: (_io.size - 64 - mask_count * mask_bytes) / (1 + head.integer_bytes * _parent.scale_record.group_length)
        doc: Number of stored components of a grid, by the bytes that they take

  prefix:
    doc-ref: v1.md#311-prefix
    seq:
      - {id: gain, type: f8, doc: Gain g}
      - {id: shift, type: f8, doc: Offset o}
      - {id: features, type: u4, doc: Features P}
      - {id: rank_sum, type: u4, doc: Sum of the appearance ranks of scales 0 to s}
      - {id: head, type: array_head, doc: Encoding of the body}
      - {id: padding, type: zeros, size: -_io.pos % 64, doc: Zeros up to the body}
      - {id: body, type: 'array(head, features)', size-eos: true, if: _parent.is_stored,
         doc: 'Matrices [P][ΣR] side by side'}
      - {id: encoded, size-eos: true, if: not _parent.is_stored, doc: Body in the codec of the entry}

  quality:
    doc: PSNR in dB; a number with all bits set was not measured
    doc-ref: v1.md#312-quality
    seq:
      - {id: encoding_psnr, type: f8, doc: Against pictures before the numbers were encoded}
      - {id: test_psnr, type: f8, doc: Against photographs of a dataset}
      - {id: original_test_psnr, type: f8, doc: The same before the numbers were encoded}
      - {id: prefix_count, type: u8, doc: 0 or the number of scales}
      - {id: prefix_psnr, type: f8, repeat: expr, repeat-expr: prefix_count, doc: 'For prefixes of 1, 2, … scales'}
      - {id: dataset, type: string, doc: 'The photographs: dataset, number and split'}

  views:
    doc-ref: v1.md#313-views
    seq:
      - {id: vertical_angle, type: f8, doc: Vertical angle of view in radians}
      - {id: initial, type: pose, doc: Initial pose of a viewer}
      - {id: target, type: vec3, doc: Point that a viewer orbits}
      - {id: duration, type: f8, doc: Duration of the path in seconds}
      - {id: closed, type: u1, doc: 1 if the path returns to its first pose}
      - {id: pose_count, type: u8, doc: Number of poses of the path n}
      - {id: path, type: pose, repeat: expr, repeat-expr: pose_count, doc: The path}

  thumbnail:
    doc-ref: v1.md#314-thumbnail
    seq:
      - {id: format, type: u1, enum: thumbnail_format, doc: Format of the image}
      - {id: reserved, type: u1, doc: Zero in version 1.0}
      - {id: width, type: u2, doc: Width in pixels}
      - {id: height, type: u2, doc: Height in pixels}
      - {id: padding, type: zeros, size: -_io.pos % 64, doc: Zeros up to the body}
      - {id: image, size-eos: true, doc: Bytes of the image file}

  probes:
    doc-ref: v1.md#316-probes
    seq:
      - {id: color_tolerance, type: f8, doc: Tolerance of colors and opacity}
      - {id: depth_tolerance, type: f8, doc: Tolerance of depth in model units}
      - {id: density_tolerance, type: f8, doc: 'Tolerance of density features, relative to max(1, |f|)'}
      - {id: probe_count, type: u8, doc: Number of probes}
      - {id: padding, type: zeros, size: -_io.pos % 64, doc: Zeros up to the body}
      - {id: probes, type: probe, repeat: expr, repeat-expr: probe_count, doc: Probes}
  probe:
    doc-ref: v1.md#316-probes
    seq:
      - {id: origin, type: vec3, doc: Origin of the ray}
      - {id: direction, type: vec3, doc: Direction of the ray}
      - {id: color, type: vec3, doc: 'Color of the pixel: red, green, blue'}
      - {id: opacity, type: f8, doc: Opacity of the pixel}
      - {id: depth, type: f8, doc: Depth of the pixel}
      - {id: point, type: vec3, doc: A point of the model}
      - {id: density, type: f8, doc: Density feature f at the point}
      - {id: margin, type: f8, doc: Decision margin of ray and point}
      - {id: reserved, size: 16, doc: Zeros in version 1.0}

  cameras:
    doc-ref: v1.md#317-cameras
    seq:
      - {id: camera_count, type: u8, doc: Number of cameras}
      - {id: padding, type: zeros, size: -_io.pos % 64, doc: Zeros up to the body}
      - {id: cameras, type: camera, repeat: expr, repeat-expr: camera_count, if: _parent.is_stored, doc: Training cameras}
      - {id: encoded, size-eos: true, if: not _parent.is_stored, doc: Body in the codec of the entry}
  camera:
    doc-ref: v1.md#317-cameras
    seq:
      - {id: pose, type: pose, doc: Pose in model space}
      - {id: focal_length, type: f8, repeat: expr, repeat-expr: 2, doc: Focal length in pixels along x and y}
      - {id: principal_point, type: f8, repeat: expr, repeat-expr: 2,
         doc: Principal point in pixels from the top left corner}
      - {id: width, type: u4, doc: Width of the photograph in pixels}
      - {id: height, type: u4, doc: Height of the photograph in pixels}
      - {id: projection, type: u1, enum: projection, doc: Projection}
      - {id: reserved, size: 7, doc: Zeros in version 1.0}
      - {id: radial, type: f8, repeat: expr, repeat-expr: 4, doc: Distortion a₁ to a₄}
      - {id: divisor, type: f8, repeat: expr, repeat-expr: 3, doc: Distortion b₁ to b₃}
      - {id: tangential, type: f8, repeat: expr, repeat-expr: 2, doc: Distortion t₁ and t₂}
      - {id: prism, type: f8, repeat: expr, repeat-expr: 2, doc: Distortion s₁ and s₂}

  notes:
    doc-ref: v1.md#318-notes
    seq:
      - {id: note_count, type: u8, doc: Number of notes}
      - {id: padding, type: zeros, size: -_io.pos % 64, doc: Zeros up to the body}
      - {id: notes, type: note, repeat: expr, repeat-expr: note_count, if: _parent.is_stored, doc: Notes}
      - {id: encoded, size-eos: true, if: not _parent.is_stored, doc: Body in the codec of the entry}
  note:
    doc-ref: v1.md#318-notes
    seq:
      - {id: key, type: string, doc: Key}
      - {id: value, type: string, doc: Value}
