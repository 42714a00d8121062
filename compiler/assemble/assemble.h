// Assemble: one document out of a map and all files it names: func_instance, misc_external_map, manifests; cordons.
//
// In       the bytes of the map, and a way to open the others
// Out      a document without instances: their brushes and entities stand where the instances put them, each with the
//          index of its file, so that diagnostics still name the line it was written in
// Errors   fault: the map itself cannot be read. Diagnostics, located at the entity that names the file, which is then
//          left out: instance-missing, instance-unreadable, instance-cycle, instance-limit, instance-placement
// Exact    plane points stay exact decimals under translations and the 24 rotations by quarter turns; under others they
//          are rounded to 1e-10 map unit
#pragma once
#include "formats/document/document.h"
#include "libs/core/context.h"
#include <functional>

namespace kiln {

struct TextFile { // what the caller read; the compiler opens no files of itself
    std::string name;
    Bytes bytes;
};
// `wanted` as a map spells it, `from` the name of the file that says so. The fault's message tells the paths tried.
using OpenMap = std::function<Result<TextFile>(const std::string& wanted, const std::string& from)>;

struct AssembleOptions {
    bool cordon = false; // leave out what lies outside the active cordons, and wall them in
    template <class A> void fields(A& a) { a(cordon); }
};

bool is_vmf(const TextFile& map);                                      // by its first word, not by its name
Result<Document> read_document(const TextFile& map, Context& context); // one file of either family, as it is
Result<Document> assemble(const TextFile& map, const OpenMap& open, const AssembleOptions& options, Context& context);

} // namespace kiln
