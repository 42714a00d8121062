// A strict reader of what the glTF writer writes: every rule of the standard that a file of ours could break is checked,
// and the numbers are given back.
#pragma once
#include "formats/gltf/gltf.h"
#include <cstring>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <set>

namespace kiln::test {

struct GltfRead {
    nlohmann::json json;
    Bytes bin;

    std::vector<std::vector<float>> floats(const nlohmann::json& accessor_index) const { // rows
        const auto& a = json["accessors"][accessor_index.get<std::size_t>()];
        const std::size_t width = a["type"] == "VEC2" ? 2 : a["type"] == "VEC3" ? 3 : a["type"] == "VEC4" ? 4 : 1;
        std::vector<std::vector<float>> rows(a["count"].get<std::size_t>(), std::vector<float>(width));
        const std::uint8_t* at = bin.data() + json["bufferViews"][a["bufferView"].get<std::size_t>()]["byteOffset"].get<std::size_t>();
        for (auto& row : rows) std::memcpy(row.data(), at, width * 4), at += width * 4;
        return rows;
    }
    std::vector<std::uint32_t> indices(const nlohmann::json& accessor_index) const {
        const auto& a = json["accessors"][accessor_index.get<std::size_t>()];
        std::vector<std::uint32_t> out(a["count"].get<std::size_t>());
        std::memcpy(out.data(), bin.data() + json["bufferViews"][a["bufferView"].get<std::size_t>()]["byteOffset"].get<std::size_t>(), out.size() * 4);
        return out;
    }

    void check() const {
        EXPECT_EQ(json["asset"]["version"], "2.0");
        const auto size = [&](const char* table) { return json.contains(table) ? json[table].size() : 0; };
        for (const char* table : {"nodes", "meshes", "materials", "accessors", "bufferViews", "buffers", "scenes"})
            EXPECT_TRUE(!json.contains(table) || !json[table].empty()) << table << " is empty, which the standard forbids";
        EXPECT_LE(size("buffers"), 1u);
        if (size("buffers")) {
            const auto length = json["buffers"][0]["byteLength"].get<std::size_t>();
            EXPECT_TRUE(bin.size() == length || (bin.size() > length && bin.size() < length + 4)) << bin.size() << " against " << length;
        }
        std::size_t end = 0;
        for (const auto& v : json.value("bufferViews", nlohmann::json::array())) {
            EXPECT_EQ(v["buffer"], 0);
            EXPECT_EQ(v["byteOffset"].get<std::size_t>() % 4, 0u);
            EXPECT_GE(v["byteOffset"].get<std::size_t>(), end) << "views overlap";
            end = v["byteOffset"].get<std::size_t>() + v["byteLength"].get<std::size_t>();
            EXPECT_LE(end, json["buffers"][0]["byteLength"].get<std::size_t>());
        }
        for (const auto& a : json.value("accessors", nlohmann::json::array())) {
            ASSERT_LT(a["bufferView"].get<std::size_t>(), size("bufferViews"));
            const auto& v = json["bufferViews"][a["bufferView"].get<std::size_t>()];
            const std::size_t width = a["type"] == "SCALAR" ? 1 : a["type"] == "VEC2" ? 2 : a["type"] == "VEC3" ? 3 : a["type"] == "VEC4" ? 4 : 0;
            ASSERT_GT(width, 0u);
            EXPECT_TRUE(a["componentType"] == 5126 || a["componentType"] == 5125);
            EXPECT_GT(a["count"].get<std::size_t>(), 0u);
            EXPECT_EQ(a["count"].get<std::size_t>() * width * 4, v["byteLength"].get<std::size_t>());
            EXPECT_EQ(v["target"], a["componentType"] == 5125 ? 34963 : 34962);
        }
        for (const auto& m : json.value("meshes", nlohmann::json::array())) {
            ASSERT_GT(m["primitives"].size(), 0u);
            for (const auto& p : m["primitives"]) check_primitive(p);
        }
        for (const auto& m : json.value("materials", nlohmann::json::array())) {
            for (const auto& x : m["pbrMetallicRoughness"]["baseColorFactor"]) EXPECT_TRUE(x >= 0 && x <= 1);
            for (const auto& x : m.value("emissiveFactor", nlohmann::json::array())) EXPECT_TRUE(x >= 0 && x <= 1);
            const std::string mode = m.value("alphaMode", "OPAQUE");
            EXPECT_TRUE(mode == "OPAQUE" || mode == "BLEND" || mode == "MASK");
        }
        std::set<std::size_t> children;
        for (const auto& n : json.value("nodes", nlohmann::json::array())) {
            if (n.contains("mesh")) { EXPECT_LT(n["mesh"].get<std::size_t>(), size("meshes")); }
            for (const auto& c : n.value("children", nlohmann::json::array())) {
                EXPECT_LT(c.get<std::size_t>(), size("nodes"));
                EXPECT_TRUE(children.insert(c.get<std::size_t>()).second) << "a node has two parents";
            }
            if (n.contains("rotation")) {
                double square = 0;
                for (const auto& x : n["rotation"]) square += x.get<double>() * x.get<double>();
                EXPECT_NEAR(square, 1, 1e-6);
            }
            if (n.contains("extensions")) {
                EXPECT_LT(n["extensions"]["KHR_lights_punctual"]["light"].get<std::size_t>(), json["extensions"]["KHR_lights_punctual"]["lights"].size());
            }
        }
        if (json.contains("scenes")) {
            for (const auto& r : json["scenes"][0]["nodes"]) EXPECT_FALSE(children.contains(r.get<std::size_t>()));
        }
        const std::string text = json.dump();
        std::set<std::string> used;
        for (const auto& e : json.value("extensionsUsed", nlohmann::json::array())) used.insert(e.get<std::string>());
        for (const char* e : {"KHR_lights_punctual", "KHR_materials_emissive_strength"})
            EXPECT_EQ(used.contains(e), text.find(std::string("\"") + e + "\":") != std::string::npos) << e;
        if (json.contains("extensions"))
            for (const auto& l : json["extensions"]["KHR_lights_punctual"]["lights"]) {
                EXPECT_TRUE(l["type"] == "point" || l["type"] == "spot" || l["type"] == "directional");
                EXPECT_EQ(l.contains("spot"), l["type"] == "spot");
                EXPECT_GE(l["intensity"], 0);
            }
    }

private:
    void check_primitive(const nlohmann::json& p) const {
        ASSERT_LT(p["material"].get<std::size_t>(), json["materials"].size());
        const auto positions = floats(p["attributes"]["POSITION"]);
        const auto& a = json["accessors"][p["attributes"]["POSITION"].get<std::size_t>()];
        std::vector<float> lo(3, 1e30f), hi(3, -1e30f);
        for (const auto& v : positions)
            for (std::size_t k = 0; k < 3; ++k) lo[k] = std::min(lo[k], v[k]), hi[k] = std::max(hi[k], v[k]);
        EXPECT_EQ(a["min"].get<std::vector<float>>(), lo);
        EXPECT_EQ(a["max"].get<std::vector<float>>(), hi);
        for (const auto& [name, index] : p["attributes"].items()) EXPECT_EQ(floats(index).size(), positions.size()) << name;
        const auto unit = [&](const char* name) {
            if (!p["attributes"].contains(name)) return;
            for (const auto& v : floats(p["attributes"][name])) {
                EXPECT_NEAR(v[0] * v[0] + v[1] * v[1] + v[2] * v[2], 1, 1e-3) << name;
                EXPECT_TRUE(v.size() < 4 || v[3] == 1 || v[3] == -1);
            }
        };
        unit("NORMAL"), unit("TANGENT");
        const auto triangles = indices(p["indices"]);
        EXPECT_EQ(triangles.size() % 3, 0u);
        for (const std::uint32_t i : triangles) EXPECT_LT(i, positions.size());
    }
};

inline GltfRead read_glb(const Bytes& bytes) {
    GltfRead out;
    const auto word = [&](std::size_t at) {
        std::uint32_t v = 0;
        if (at + 4 <= bytes.size()) std::memcpy(&v, bytes.data() + at, 4);
        else ADD_FAILURE() << "the file ends early";
        return v;
    };
    EXPECT_EQ(word(0), 0x46546C67u);
    EXPECT_EQ(word(4), 2u);
    EXPECT_EQ(word(8), bytes.size());
    const std::size_t json_size = word(12);
    EXPECT_EQ(word(16), 0x4E4F534Au);
    EXPECT_EQ(json_size % 4, 0u);
    out.json = nlohmann::json::parse(bytes.begin() + 20, bytes.begin() + 20 + static_cast<std::ptrdiff_t>(json_size));
    const std::size_t at = 20 + json_size;
    if (at < bytes.size()) {
        EXPECT_EQ(word(at + 4), 0x004E4942u);
        EXPECT_EQ(at + 8 + word(at), bytes.size());
        out.bin.assign(bytes.begin() + static_cast<std::ptrdiff_t>(at) + 8, bytes.end());
    }
    return out;
}

} // namespace kiln::test
