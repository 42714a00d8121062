// Maps as text and an opener over them, for tests of what is put together from files.
#pragma once
#include "compiler/assemble/assemble.h"
#include "compiler/assemble/placement.h"
#include <algorithm>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <map>
#include <stdexcept>

namespace kiln::test {

inline TextFile file(const std::string& name, const std::string& text) { return {name, Bytes(text.begin(), text.end())}; }

using Files = std::map<std::string, std::string>; // by the name that maps use
inline OpenMap opener(const Files& files) {
    return [files](const std::string& wanted, const std::string&) -> Result<TextFile> {
        const auto it = files.find(wanted);
        if (it == files.end()) return fault(Exit::input, "cannot-read", "not found; tried " + wanted);
        return file(it->first, it->second);
    };
}

// A box as a VMF solid; sides -x +x -y +y -z +z with ids from `id`.
inline std::string vmf_box(Vec3 lo, Vec3 hi, int id, const std::string& material = "wall", const std::string& extra = "") {
    const auto p = [](double x, double y, double z) { return fmt::format("({} {} {})", x, y, z); };
    const std::string planes[6] = {
        p(lo.x, lo.y, lo.z) + p(lo.x, hi.y, lo.z) + p(lo.x, lo.y, hi.z), p(hi.x, lo.y, lo.z) + p(hi.x, lo.y, hi.z) + p(hi.x, hi.y, lo.z),
        p(lo.x, lo.y, lo.z) + p(lo.x, lo.y, hi.z) + p(hi.x, lo.y, lo.z), p(lo.x, hi.y, lo.z) + p(hi.x, hi.y, lo.z) + p(lo.x, hi.y, hi.z),
        p(lo.x, lo.y, lo.z) + p(hi.x, lo.y, lo.z) + p(lo.x, hi.y, lo.z), p(lo.x, lo.y, hi.z) + p(lo.x, hi.y, hi.z) + p(hi.x, lo.y, hi.z),
    };
    std::string text = fmt::format("solid\n{{\n\"id\" \"{}\"\n", id);
    for (int i = 0; i < 6; ++i) {
        const char* u = i < 2 ? "0 1 0" : "1 0 0";
        const char* v = i < 4 ? "0 0 -1" : "0 -1 0";
        text += fmt::format("side\n{{\n\"id\" \"{}\"\n\"plane\" \"{}\"\n\"material\" \"{}\"\n\"uaxis\" \"[{} 3.5] 0.25\"\n\"vaxis\" \"[{} -7] 0.5\"\n{}\n}}\n", id + i, planes[i],
                            material, u, v, extra);
    }
    return text + "}\n";
}
inline std::string vmf_world(const std::string& solids) { return "world\n{\n\"id\" \"1\"\n\"classname\" \"worldspawn\"\n" + solids + "}\n"; }
using Keys = std::vector<std::pair<std::string, std::string>>;
inline std::string vmf_entity(const std::string& classname, const Keys& keys, const Keys& outputs = {}, const std::string& solids = "") {
    std::string text = "entity\n{\n\"id\" \"7\"\n\"classname\" \"" + classname + "\"\n";
    for (const auto& [k, v] : keys) text += fmt::format("\"{}\" \"{}\"\n", k, v);
    if (!outputs.empty()) {
        text += "connections\n{\n";
        for (const auto& [k, v] : outputs) text += fmt::format("\"{}\" \"{}\"\n", k, v);
        text += "}\n";
    }
    return text + solids + "}\n";
}

inline Document assembled(const std::string& main, const Files& files, Context& context, AssembleOptions options = {}) {
    Result<Document> document = assemble(file("main.vmf", main), opener(files), options, context);
    if (!document) throw std::runtime_error(to_text(document.fault().diagnostic)); // ends the test
    return *std::move(document);
}
inline Document assembled(const std::string& main, const Files& files, AssembleOptions options = {}) {
    Context context;
    Document document = assembled(main, files, context, options);
    for (const Diagnostic& d : context.diagnostics())
        if (d.severity != Severity::note) ADD_FAILURE() << to_text(d);
    return document;
}

inline std::size_t count(const Context& context, std::string_view code) {
    return static_cast<std::size_t>(std::ranges::count(context.diagnostics(), code, &Diagnostic::code));
}
inline const Diagnostic& first(const Context& context, std::string_view code) {
    const auto it = std::ranges::find(context.diagnostics(), code, &Diagnostic::code);
    if (it == context.diagnostics().end()) throw std::runtime_error("no diagnostic " + std::string(code));
    return *it;
}
inline const DocEntity& entity(const Document& document, std::string_view classname, std::size_t n = 0) {
    for (const DocEntity& e : document.entities)
        if (equal_ignoring_case(e.get("classname"), classname) && n-- == 0) return e;
    throw std::runtime_error("no entity " + std::string(classname));
}
// The values of all outputs of that event, in order.
inline std::vector<std::string> outputs(const DocEntity& e, std::string_view event) {
    std::vector<std::string> values;
    for (const DocKey& k : e.keys)
        if (k.output && k.key == event) values.push_back(k.value);
    return values;
}
inline Vec3 vec(const std::array<Decimal, 3>& p) { return {p[0].to_double(), p[1].to_double(), p[2].to_double()}; }
inline Vec2 texel(const DocTexture& t, Vec3 p) {
    return {dot(p, t.u_axis) / t.u_scale + t.u_shift, dot(p, t.v_axis) / t.v_scale + t.v_shift};
}

} // namespace kiln::test
