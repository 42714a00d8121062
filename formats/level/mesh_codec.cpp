// SPDX-License-Identifier: MIT
// Draco's edgebreaker reorders faces and vertices, turns triangles, and splits vertices where the surface is not a
// manifold; it drops faces whose corners coincide (the writer has taken those out). So the stream carries positions
// and connectivity only: vertices are known again by their grid position, and a side table keyed by Draco's own
// order says which triangle of the file each decoded one is, and which of its corners comes first.
#include "formats/level/mesh_codec.h"
#include "formats/level/numbers.h"
#include <algorithm>
#include <draco/compression/decode.h>
#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>
#include <memory>
#include <optional>
#include <unordered_map>

namespace kiln::level {
namespace {

using Position = std::array<std::int32_t, 3>;
using Triangle = std::array<std::uint32_t, 3>;

constexpr int kEncodeSpeed = 3; // 0 is a few percent smaller and several times slower

struct HashPosition {
    std::size_t operator()(const Position& p) const noexcept {
        std::uint64_t h = 0;
        for (const std::int32_t c : p) h = (h ^ static_cast<std::uint32_t>(c)) * 0x9E3779B97F4A7C15ull, h ^= h >> 29;
        return h;
    }
};

// Renumbers corners, given as positions, by first use.
GridMesh by_first_use(const std::vector<std::array<Position, 3>>& corners) {
    GridMesh mesh;
    std::unordered_map<Position, std::uint32_t, HashPosition> number;
    mesh.triangles.reserve(corners.size());
    for (const auto& corner : corners) {
        Triangle t{};
        for (std::size_t k = 0; k < 3; ++k) {
            const auto [it, fresh] = number.try_emplace(corner[k], static_cast<std::uint32_t>(mesh.positions.size()));
            if (fresh) mesh.positions.push_back(corner[k]);
            t[k] = it->second;
        }
        mesh.triangles.push_back(t);
    }
    return mesh;
}

Blob draco_stream(const GridMesh& mesh) {
    draco::Mesh out;
    const auto vertex_count = static_cast<std::uint32_t>(mesh.positions.size());
    out.set_num_points(vertex_count);
    draco::GeometryAttribute attribute;
    attribute.Init(draco::GeometryAttribute::POSITION, nullptr, 3, draco::DT_INT32, false, 12, 0);
    const int id = out.AddAttribute(attribute, true, vertex_count);
    for (std::uint32_t i = 0; i < vertex_count; ++i)
        out.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i), mesh.positions[i].data());
    out.SetNumFaces(mesh.triangles.size());
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
        draco::Mesh::Face face;
        for (std::size_t k = 0; k < 3; ++k) face[k] = draco::PointIndex(mesh.triangles[i][k]);
        out.SetFace(draco::FaceIndex(i), face);
    }
    draco::Encoder encoder;
    encoder.SetEncodingMethod(draco::MESH_EDGEBREAKER_ENCODING);
    encoder.SetSpeedOptions(kEncodeSpeed, kEncodeSpeed);
    draco::EncoderBuffer buffer;
    if (!encoder.EncodeMeshToBuffer(out, &buffer).ok()) return {};
    const auto* data = reinterpret_cast<const std::uint8_t*>(buffer.data());
    return Blob(data, data + buffer.size());
}

// The corners of what Draco gives back, in its order.
std::vector<std::array<Position, 3>> draco_corners(std::span<const std::uint8_t> stream,
                                                   std::uint32_t triangle_count) {
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(stream.data()), stream.size());
    const auto kind = draco::Decoder::GetEncodedGeometryType(&buffer);
    if (!kind.ok() || kind.value() != draco::TRIANGULAR_MESH) throw Damaged("the mesh stream is no mesh");
    draco::Decoder decoder;
    auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
    if (!decoded.ok()) throw Damaged("the mesh stream does not decode");
    const std::unique_ptr<draco::Mesh> mesh = std::move(decoded).value();
    const draco::PointAttribute* attribute = mesh->GetNamedAttribute(draco::GeometryAttribute::POSITION);
    if (!attribute || attribute->data_type() != draco::DT_INT32 || attribute->num_components() != 3)
        throw Damaged("the mesh stream has no integer positions");
    if (mesh->num_faces() != triangle_count) throw Damaged("the mesh stream has another number of triangles");
    std::vector<std::array<Position, 3>> corners(triangle_count);
    for (std::uint32_t i = 0; i < triangle_count; ++i) {
        const draco::Mesh::Face& face = mesh->face(draco::FaceIndex(i));
        for (std::size_t k = 0; k < 3; ++k) {
            // Draco accepts indices past its own tables in damaged streams: check both steps.
            if (face[k].value() >= mesh->num_points()) throw Damaged("the mesh stream names a point not there");
            const draco::AttributeValueIndex v = attribute->mapped_index(face[k]);
            if (v.value() >= attribute->size()) throw Damaged("the mesh stream names a position not there");
            std::memcpy(corners[i][k].data(), attribute->GetAddress(v), sizeof(Position));
        }
    }
    return corners;
}

// Smallest number first, order kept; `turn`: which corner that was.
Triangle turned(Triangle t, std::uint32_t* turn) {
    const auto least = static_cast<std::uint32_t>(std::min_element(t.begin(), t.end()) - t.begin());
    *turn = least;
    return {t[least], t[(least + 1) % 3], t[(least + 2) % 3]};
}

// For each decoded triangle: 3 * (its number in the file) + how far its corners must be turned; nothing where the
// two meshes do not have the same triangles.
std::optional<std::vector<std::uint32_t>> order_table(const GridMesh& mesh,
                                                      const std::vector<std::array<Position, 3>>& decoded) {
    if (decoded.size() != mesh.triangles.size()) return std::nullopt;
    std::unordered_map<Position, std::uint32_t, HashPosition> number;
    for (std::uint32_t i = 0; i < mesh.positions.size(); ++i) number.emplace(mesh.positions[i], i);
    std::vector<std::pair<Triangle, std::uint32_t>> wanted; // turned triangle, 3 * number + turn; sorted
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
        std::uint32_t turn = 0;
        const Triangle t = turned(mesh.triangles[i], &turn);
        wanted.emplace_back(t, 3 * i + turn);
    }
    std::sort(wanted.begin(), wanted.end());
    std::vector<std::uint32_t> taken(wanted.size()); // at the first of each run of equals: how many were found
    std::vector<std::uint32_t> table;
    for (const auto& corners : decoded) {
        Triangle t{};
        for (std::size_t k = 0; k < 3; ++k) {
            const auto it = number.find(corners[k]);
            if (it == number.end()) return std::nullopt;
            t[k] = it->second;
        }
        std::uint32_t turn = 0;
        t = turned(t, &turn);
        const auto first = std::lower_bound(wanted.begin(), wanted.end(), std::pair{t, std::uint32_t{0}});
        const auto at = static_cast<std::size_t>(first - wanted.begin());
        if (at >= wanted.size()) return std::nullopt;
        const std::size_t mine = at + taken[at]++;
        if (mine >= wanted.size() || wanted[mine].first != t) return std::nullopt;
        // File corner c is turned corner (c + 3 - its turn), which is decoded corner (that + decoded turn).
        const std::uint32_t file_turn = wanted[mine].second % 3;
        table.push_back(wanted[mine].second - file_turn + (turn + 3 - file_turn) % 3);
    }
    return table;
}

GridMesh in_file_order(const std::vector<std::array<Position, 3>>& decoded, const std::vector<std::uint32_t>& table) {
    std::vector<std::array<Position, 3>> corners(decoded.size());
    std::vector<bool> filled(decoded.size());
    for (std::size_t i = 0; i < decoded.size(); ++i) {
        const std::size_t to = table[i] / 3, turn = table[i] % 3;
        if (to >= corners.size() || filled[to]) throw Damaged("the triangle order of the mesh is no permutation");
        filled[to] = true;
        for (std::size_t k = 0; k < 3; ++k) corners[to][k] = decoded[i][(k + turn) % 3];
    }
    return by_first_use(corners);
}

std::uint32_t difference(std::uint32_t to, std::uint32_t from) { return zigzag(static_cast<std::int32_t>(to - from)); }

void put_plain(Put& out, const GridMesh& mesh) {
    for (std::size_t axis = 0; axis < 3; ++axis)
        out.planes<std::uint32_t>(mesh.positions.size(), [&](std::size_t i) {
            const std::int32_t before = i == 0 ? 0 : mesh.positions[i - 1][axis];
            return difference(static_cast<std::uint32_t>(mesh.positions[i][axis]), static_cast<std::uint32_t>(before));
        });
    const auto corner = [&](std::size_t i) { return mesh.triangles[i / 3][i % 3]; };
    out.planes<std::uint32_t>(mesh.triangles.size() * 3,
                              [&](std::size_t i) { return difference(corner(i), i == 0 ? 0 : corner(i - 1)); });
}

GridMesh get_plain(Get& in, std::uint32_t vertex_count, std::uint32_t triangle_count) {
    GridMesh mesh;
    std::vector<std::uint32_t> deltas;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        in.column(deltas, vertex_count);
        mesh.positions.resize(vertex_count);
        std::uint32_t value = 0;
        for (std::uint32_t i = 0; i < vertex_count; ++i) {
            value += static_cast<std::uint32_t>(unzigzag(deltas[i]));
            mesh.positions[i][axis] = static_cast<std::int32_t>(value);
        }
    }
    in.column(deltas, std::size_t{triangle_count} * 3);
    mesh.triangles.resize(triangle_count);
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < deltas.size(); ++i) {
        value += static_cast<std::uint32_t>(unzigzag(deltas[i]));
        if (value >= vertex_count) throw Damaged("a triangle names a vertex that is not there");
        mesh.triangles[i / 3][i % 3] = value;
    }
    return mesh;
}

} // namespace

Blob encode_mesh(const GridMesh& mesh, MeshCodec wanted) {
    Put out;
    if (wanted == MeshCodec::draco && !mesh.triangles.empty()) {
        const Blob stream = draco_stream(mesh);
        std::optional<std::vector<std::uint32_t>> table;
        try {
            if (!stream.empty())
                table = order_table(mesh, draco_corners(stream, static_cast<std::uint32_t>(mesh.triangles.size())));
        } catch (const Damaged&) { // what Draco gave back is not what it was given: plain
        }
        if (table) {
            out.value(static_cast<std::uint8_t>(MeshCodec::draco));
            out.value(static_cast<std::uint32_t>(stream.size()));
            out.raw(stream);
            out.planes<std::uint32_t>(table->size(), [&](std::size_t i) {
                return difference((*table)[i], i == 0 ? 0 : (*table)[i - 1]);
            });
            const auto counts = [](std::size_t n) { return static_cast<std::uint32_t>(n); };
            if (decode_mesh(out.bytes, counts(mesh.positions.size()), counts(mesh.triangles.size())) == mesh)
                return std::move(out.bytes);
            out.bytes.clear();
        }
    }
    out.value(static_cast<std::uint8_t>(MeshCodec::plain));
    put_plain(out, mesh);
    return std::move(out.bytes);
}

GridMesh decode_mesh(std::span<const std::uint8_t> bytes, std::uint32_t vertex_count, std::uint32_t triangle_count) {
    Get in(bytes);
    const auto codec = in.value<std::uint8_t>();
    GridMesh mesh;
    if (codec == static_cast<std::uint8_t>(MeshCodec::plain)) {
        mesh = get_plain(in, vertex_count, triangle_count);
    } else if (codec == static_cast<std::uint8_t>(MeshCodec::draco)) {
        const auto stream = in.raw(in.value<std::uint32_t>());
        std::vector<std::uint32_t> table; // first: its length bounds triangle_count before Draco allocates
        in.column(table, triangle_count);
        for (std::size_t i = 0; i < table.size(); ++i)
            table[i] = static_cast<std::uint32_t>(unzigzag(table[i])) + (i == 0 ? 0 : table[i - 1]);
        mesh = in_file_order(draco_corners(stream, triangle_count), table);
        if (mesh.positions.size() != vertex_count) throw Damaged("the mesh stream has another number of vertices");
    } else {
        throw Damaged("unknown mesh codec");
    }
    in.end();
    return mesh;
}

} // namespace kiln::level
