#include "compiler/assemble/assemble.h"
#include "compiler/assemble/cordon.h"
#include "compiler/assemble/entity_keys.h"
#include "formats/document/side_text.h"
#include "formats/quake_map/quake_map.h"
#include "formats/vmf/manifest.h"
#include "formats/vmf/vmf.h"
#include <algorithm>
#include <cctype>
#include <cmath>
#include <fmt/format.h>
#include <iterator>
#include <memory>

namespace kiln {
namespace {

using namespace assemble_detail;

constexpr std::size_t kDeepest = 64;           // files inside files
constexpr std::size_t kMostSides = 4000000; // that instances bring; the largest levels have a twentieth of it
constexpr std::size_t kMostInstances = 100000; // a few short files can name each other in numbers no memory holds

bool is_class(const DocEntity& e, std::string_view name) { return equal_ignoring_case(e.get("classname"), name); }
bool is_instance(const DocEntity& e) { return is_class(e, "func_instance"); }
bool starts_with_ignoring_case(std::string_view text, std::string_view start) {
    return equal_ignoring_case(text.substr(0, start.size()), start);
}

// "instance:name;Output" of the entities that speak through an instance's walls.
struct Through {
    std::string name, event;
};
std::optional<Through> through(std::string_view text) {
    constexpr std::string_view kMark = "instance:";
    if (!starts_with_ignoring_case(text, kMark)) return std::nullopt;
    text.remove_prefix(kMark.size());
    const std::size_t semicolon = text.find(';');
    if (semicolon == std::string_view::npos) return std::nullopt;
    return Through{std::string(text.substr(0, semicolon)), std::string(text.substr(semicolon + 1))};
}

template <class T> void append(std::vector<T>& to, std::vector<T>& from) {
    to.insert(to.end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
    from.clear();
}

class Assembler {
public:
    Assembler(const OpenMap& open, Context& context) : open_(open), context_(context) {}

    Result<Document> run(const TextFile& map) {
        if (is_manifest(map.bytes)) return run_manifest(map);
        Result<Document> read = read_document(map, context_);
        if (!read) return read;
        Document document = *std::move(read);
        start(document);
        open_files_.push_back(map.name);
        expand(document);
        return finish(std::move(document));
    }

private:
    const OpenMap& open_;
    Context& context_;
    std::vector<std::string> included_;                                     // Document::included
    std::map<std::string, std::shared_ptr<const Document>> read_;           // by name; null: cannot be read
    std::map<std::pair<std::string, std::string>, Result<std::string>> found_; // (wanted, from) -> name
    std::vector<std::string> open_files_;                                   // those we are inside of
    std::string main_;
    std::size_t instances_ = 0;
    std::size_t sides_ = 0; // that instances have brought
    FreshIds next_side_, next_node_;
    int next_auto_ = 1;

    const std::string& name_of(std::uint16_t file) const { return file == 0 ? main_ : included_[file - 1u]; }
    SourceLocation where(const DocEntity& e) const { return {name_of(e.file), e.line, e.id}; }
    SourceLocation where(const DocEntity& e, const DocKey& k) const { return {name_of(e.file), k.line, e.id}; }

    void start(const Document& document) {
        main_ = document.file;
        for (const DocEntity& e : document.entities) {
            for (const DocBrush& b : e.brushes)
                for (const DocSide& s : b.sides) next_side_.taken.push_back(s.id);
            next_node_.taken.push_back(static_cast<int>(std::clamp(e.number("nodeid", 0), 0.0, 1e9)));
        }
        for (FreshIds* ids : {&next_side_, &next_node_}) {
            std::ranges::sort(ids->taken);
            if (!ids->taken.empty()) ids->next = std::max(ids->next, std::min(ids->taken.back(), INT32_MAX - 1) + 1);
        }
    }

    Result<Document> finish(Document document) {
        resolve_proxies(document);
        document.included = included_;
        return document;
    }

    // Each map of a manifest is an instance without a name at the origin; worldspawn's keys are those of the primary one.
    Result<Document> run_manifest(const TextFile& map) {
        Result<std::vector<ManifestMap>> maps = read_manifest(map.bytes, map.name, context_);
        if (!maps) return maps.fault();
        std::ranges::stable_sort(*maps, {}, [](const ManifestMap& m) { return !m.primary; });
        main_ = map.name;
        open_files_.push_back(map.name);
        Document document;
        document.file = map.name;
        for (const ManifestMap& m : *maps) {
            DocEntity entity; // stands for the line of the manifest
            entity.line = m.line;
            entity.keys = {{"file", m.file, m.line}};
            std::optional<Document> part = load(m.file, entity, {}, document.entities.empty());
            if (!part) continue;
            if (document.entities.empty()) document.format = part->format;
            else part->entities[0].keys.clear();
            append(document.cordons, part->cordons);
            merge(document, document.entities, std::move(*part));
        }
        if (document.entities.empty())
            return fault(Exit::input, "manifest-empty", "none of the manifest's maps could be read", {map.name, 1});
        return finish(std::move(document));
    }

    // The document of a file, read once. Nothing: reported at `entity`.
    std::shared_ptr<const Document> document_of(const std::string& wanted, const DocEntity& entity, const SourceLocation& at) {
        const std::string& from = name_of(entity.file);
        auto found = found_.find({wanted, from});
        if (found == found_.end()) {
            Result<TextFile> file = open_ ? open_(wanted, from) : Result<TextFile>(fault(Exit::input, "cannot-read", "no other files can be opened here"));
            if (file && !read_.contains(file->name)) {
                Result<Document> document = is_manifest(file->bytes) ? Result<Document>(fault(Exit::input, "instance-unreadable", "manifests (.vmm) hold maps and no other manifests", {file->name, 1}))
                                                                    : read_document(*file, context_);
                if (!document) { // the map around it is built all the same
                    Diagnostic why = document.fault().diagnostic;
                    why.severity = Severity::warning;
                    context_.report(std::move(why));
                }
                read_[file->name] = document ? std::make_shared<const Document>(*std::move(document)) : nullptr;
            }
            found = found_.emplace(std::pair{wanted, from}, file ? Result<std::string>(file->name) : Result<std::string>(file.fault())).first;
        }
        if (!found->second) {
            context_.report(Severity::warning, "instance-missing",
                            fmt::format("the map '{}' is left out: {}", wanted, found->second.fault().diagnostic.message), at);
            return nullptr;
        }
        const std::shared_ptr<const Document>& document = read_.at(*found->second);
        if (!document)
            context_.report(Severity::warning, "instance-unreadable", fmt::format("the map '{}' cannot be read; it is left out", *found->second), at);
        return document;
    }

    // What a file holds, in its own coordinates and names, with all instances in it expanded.
    std::optional<Document> load(const std::string& wanted, const DocEntity& entity, Replacements replacements, bool keep_ids) {
        const DocKey* key = entity.find("file");
        const SourceLocation at = key ? where(entity, *key) : where(entity);
        const std::shared_ptr<const Document> source = document_of(wanted, entity, at);
        if (!source) return std::nullopt;
        if (const auto inside = std::ranges::find(open_files_, source->file); inside != open_files_.end()) {
            std::string way;
            for (auto it = inside; it != open_files_.end(); ++it) way += *it + " -> ";
            context_.report(Severity::error, "instance-cycle", fmt::format("a map cannot hold itself ({}{}); it is left out", way, source->file), at);
            return std::nullopt;
        }
        if (open_files_.size() > kDeepest || ++instances_ > kMostInstances) {
            context_.report(Severity::error, "instance-limit",
                            fmt::format("more than {} files inside each other, or {} in all; '{}' is left out", kDeepest, kMostInstances, wanted), at);
            return std::nullopt;
        }
        for (const DocEntity& e : source->entities)
            for (const DocBrush& b : e.brushes) sides_ += b.sides.size();
        if (sides_ > kMostSides) {
            context_.report(Severity::error, "instance-limit", fmt::format("instances bring more than {} brush sides; '{}' is left out", kMostSides, wanted), at);
            return std::nullopt;
        }
        const std::optional<std::uint16_t> file = index_of(source->file, at);
        if (!file) return std::nullopt;
        Document document = *source;
        if (keep_ids) start_numbers(document);
        add_defaults(document, replacements);
        std::erase_if(document.entities, [](const DocEntity& e) { return is_class(e, "func_instance_parms"); });
        for (DocEntity& e : document.entities) {
            e.file = *file;
            for (DocBrush& b : e.brushes) b.file = *file;
            for (DocPatch& p : e.patches) p.file = *file;
        }
        if (!replacements.empty()) replace(document, replacements);
        if (!keep_ids) renumber(document);
        open_files_.push_back(source->file);
        expand(document);
        open_files_.pop_back();
        return document;
    }

    void start_numbers(const Document& document) {
        std::string main = main_;
        start(document);
        main_ = std::move(main);
    }

    std::optional<std::uint16_t> index_of(const std::string& name, const SourceLocation& at) {
        const auto it = std::ranges::find(included_, name);
        if (it == included_.end()) {
            if (included_.size() >= UINT16_MAX) {
                context_.report(Severity::error, "instance-limit", fmt::format("more than {} different files; '{}' is left out", UINT16_MAX, name), at);
                return std::nullopt;
            }
            included_.push_back(name);
            return static_cast<std::uint16_t>(included_.size());
        }
        return static_cast<std::uint16_t>(it - included_.begin() + 1);
    }

    // func_instance_parms: "parm1" "$variable type default"; what the instance does not set takes its default.
    static void add_defaults(const Document& document, Replacements& replacements) {
        for (const DocEntity& e : document.entities) {
            if (!is_class(e, "func_instance_parms")) continue;
            for (const DocKey& k : e.keys) {
                if (!starts_with_ignoring_case(k.key, "parm")) continue;
                const std::size_t name_end = k.value.find(' ');
                const std::size_t type_end = name_end == std::string::npos ? name_end : k.value.find(' ', name_end + 1);
                const std::string name = k.value.substr(0, name_end);
                if (type_end == std::string::npos || !name.starts_with('$')) continue;
                if (std::ranges::none_of(replacements, [&](const auto& r) { return equal_ignoring_case(r.first, name); }))
                    replacements.emplace_back(name, k.value.substr(type_end + 1));
            }
        }
    }

    static Replacements replacements_of(const DocEntity& e) {
        Replacements list;
        for (const DocKey& k : e.keys) {
            if (k.output || !starts_with_ignoring_case(k.key, "replace")) continue;
            const std::size_t space = k.value.find(' ');
            const std::string name = k.value.substr(0, space);
            if (name.size() > 1 && (name[0] == '$' || name[0] == '#')) list.emplace_back(name, space == std::string::npos ? "" : k.value.substr(space + 1));
        }
        return list;
    }

    static std::string slashes(std::string text) {
        std::ranges::replace(text, '\\', '/');
        return lower_case(text);
    }

    // A text that grows beyond all measure (values that name variables, file after file) keeps its variables, and is told.
    void replace_in(std::string& text, const Replacements& variables, const SourceLocation& at) {
        if (std::optional<std::string> r = replaced(text, variables)) text = *std::move(r);
        else context_.report(Severity::error, "instance-limit", fmt::format("with its variables replaced, '{}' would be longer than {} bytes; they stay", shown(text), kMostReplaced), at);
    }

    void replace(Document& document, const Replacements& all) {
        Replacements variables, materials; // "#material other" names a whole material
        for (const auto& r : all)
            (r.first[0] == '#' ? materials : variables).emplace_back(r.first[0] == '#' ? slashes(r.first.substr(1)) : r.first, r.second);
        for (DocEntity& e : document.entities) {
            for (DocKey& k : e.keys) replace_in(k.key, variables, where(e, k)), replace_in(k.value, variables, where(e, k));
            const auto in_material = [&](std::string& material, int line) {
                replace_in(material, variables, {name_of(e.file), line, e.id});
                for (const auto& [from, to] : materials)
                    if (slashes(material) == from) {
                        material = to;
                        break;
                    }
            };
            for (DocBrush& b : e.brushes)
                for (DocSide& s : b.sides) in_material(s.material, s.line);
            for (DocPatch& p : e.patches) in_material(p.material, p.line);
        }
    }

    void renumber(Document& document) {
        if (document.format != MapFormat::vmf) return; // sides of others have no ids but their ordinals
        IdMap sides{{}, &next_side_}, nodes{{}, &next_node_};
        for (DocEntity& e : document.entities)
            for (DocBrush& b : e.brushes)
                for (DocSide& s : b.sides)
                    if (s.id >= 0) s.id = sides(s.id);
        for (DocEntity& e : document.entities) renumber_sides(e, sides), renumber_nodes(e, nodes);
    }

    // The entities of `part` become part of `entities`, its world's brushes of the first one's.
    static void merge(Document& document, std::vector<DocEntity>& entities, Document part) {
        const auto base = static_cast<std::int32_t>(document.displacements.size());
        for (DocEntity& e : part.entities)
            for (DocBrush& b : e.brushes)
                for (DocSide& s : b.sides)
                    if (s.displacement >= 0) s.displacement += base;
        append(document.displacements, part.displacements);
        if (entities.empty()) {
            entities = std::move(part.entities);
            return;
        }
        append(entities[0].brushes, part.entities[0].brushes);
        append(entities[0].patches, part.entities[0].patches);
        entities[0].skipped_primitives += part.entities[0].skipped_primitives;
        entities.insert(entities.end(), std::make_move_iterator(part.entities.begin() + 1), std::make_move_iterator(part.entities.end()));
    }

    static void place_all(Document& part, const Placement& placement) {
        for (DocEntity& e : part.entities) {
            for (DocBrush& b : e.brushes)
                for (DocSide& s : b.sides) place(s, placement);
            for (DocPatch& p : e.patches) place(p, placement);
        }
        for (DocDisplacement& d : part.displacements) place(d, placement);
    }

    // Nothing: reported.
    std::optional<DecimalPoint> numbers_of(const DocEntity& e, std::string_view name, const char* otherwise, double largest) {
        const DocKey* key = e.find(name);
        const std::string text = key ? key->value : otherwise;
        DecimalPoint p;
        std::size_t at = 0;
        for (std::size_t i = 0; i < 3; ++i) {
            const std::size_t first = std::min(text.find_first_not_of(" \t", at), text.size());
            at = std::min(text.find_first_of(" \t", first), text.size());
            const std::optional<Decimal> x = parse_decimal(std::string_view(text).substr(first, at - first));
            if (!x || !(std::fabs(x->to_double()) <= largest)) {
                context_.report(Severity::error, "instance-placement",
                                fmt::format("the key {} '{}' is not three numbers within {}; the instance is left out", name, shown(text), largest),
                                key ? where(e, *key) : where(e));
                return std::nullopt;
            }
            p[i] = *x;
        }
        return p;
    }
    static constexpr double kLargestAngle = 1e6; // degrees: of those beyond, doubles keep no turn

    std::optional<Placement> placement_of(const DocEntity& e) {
        Placement placement;
        const std::optional<DecimalPoint> origin = numbers_of(e, "origin", "0 0 0", kLargestCoordinate);
        const std::optional<DecimalPoint> angles = numbers_of(e, "angles", "0 0 0", kLargestAngle);
        if (!origin || !angles) return std::nullopt;
        placement.origin = *origin;
        placement.rotation = matrix_of_angles(to_vec(*angles));
        return placement;
    }

    void expand(Document& document) {
        const bool any = std::ranges::any_of(document.entities, [](const DocEntity& e) { return is_instance(e) || is_class(e, "misc_external_map"); });
        if (!any) return;
        std::map<std::string, NameFixup> names; // of the instances here, lower case, for the outputs that reach into them
        std::vector<DocEntity> result;
        std::vector<std::size_t> own;           // those of `result` that this file wrote itself
        result.reserve(document.entities.size());
        for (std::size_t i = 0; i < document.entities.size(); ++i) {
            context_.check_cancelled();
            DocEntity& e = document.entities[i];
            if (i > 0 && is_instance(e)) {
                add_instance(document, result, e, names);
                continue;
            }
            if (i > 0 && is_class(e, "misc_external_map")) add_external_map(document, e);
            own.push_back(result.size());
            result.push_back(std::move(e));
        }
        for (const std::size_t i : own) reach_into(result[i], names);
        document.entities = std::move(result);
    }

    void add_instance(Document& document, std::vector<DocEntity>& result, const DocEntity& e, std::map<std::string, NameFixup>& names) {
        const std::string wanted(e.get("file"));
        if (wanted.empty()) { // an editor keeps such while it is not set
            context_.report(Severity::warning, "instance-missing", "a func_instance names no file; it is left out", where(e));
            return;
        }
        const std::optional<Placement> placement = placement_of(e);
        if (!placement) return;
        std::optional<Document> part = load(wanted, e, replacements_of(e), false);
        if (!part) return;

        NameFixup fix;
        fix.instance = e.get("targetname");
        if (fix.instance.empty()) fix.instance = fmt::format("InstanceAuto{}", next_auto_++);
        const double style = e.number("fixup_style", 0);
        fix.style = style == 1 ? FixupStyle::postfix : style == 2 ? FixupStyle::none : FixupStyle::prefix;
        for (const DocEntity& inner : part->entities) {
            if (const std::string_view name = inner.get("targetname"); !name.empty()) fix.names.insert(lower_case(name));
            fix.classes.insert(lower_case(inner.get("classname")));
        }
        // By the names they have inside, before they lose them.
        std::vector<std::pair<std::size_t, DocKey>> outputs;
        for (const DocKey& k : e.keys)
            if (k.output) collect_output(e, k, *part, outputs);
        for (DocEntity& inner : part->entities) {
            fix_names(inner, fix);
            place_keys(inner, *placement, where(inner), context_);
        }
        for (auto& [entity, key] : outputs) part->entities[entity].keys.push_back(std::move(key));
        place_all(*part, *placement);
        names.try_emplace(lower_case(e.get("targetname")), fix);
        merge(document, result, std::move(*part));
    }

    // "instance:relay;OnTrigger" on the instance is an output of the entity `relay` in it.
    void collect_output(const DocEntity& e, const DocKey& k, const Document& part, std::vector<std::pair<std::size_t, DocKey>>& outputs) {
        const std::optional<Through> t = through(k.key);
        bool any = false;
        for (std::size_t i = 0; t && i < part.entities.size(); ++i) {
            if (!equal_ignoring_case(part.entities[i].get("targetname"), t->name)) continue;
            outputs.push_back({i, {t->event, k.value, k.line, true}});
            any = true;
        }
        if (!any)
            context_.report(Severity::note, "instance-output-unknown",
                            fmt::format("the output {} of a func_instance names no entity of the instance; it is left out", shown(k.key)), where(e, k));
    }

    // Outputs "instance,instance:name;Input,..." reach the entity `name` in the instance.
    void reach_into(DocEntity& e, const std::map<std::string, NameFixup>& names) {
        for (DocKey& k : e.keys) {
            if (!k.output) continue;
            Output output = Output::parse(k.value);
            if (output.fields.size() < 2) continue;
            const std::optional<Through> t = through(output.fields[1]);
            if (!t) continue;
            const auto it = names.find(lower_case(output.fields[0]));
            if (it == names.end() || !it->second.names.contains(lower_case(t->name))) {
                context_.report(Severity::note, "instance-output-unknown",
                                fmt::format("no entity '{}' in an instance '{}': the output has no effect", shown(t->name), shown(output.fields[0])), where(e, k));
                continue;
            }
            output.fields[0] = it->second(t->name);
            output.fields[1] = t->event;
            k.value = output.text();
        }
    }

    // The entity takes all brushes of the other map and the class it asks for; other keys stay its own.
    void add_external_map(Document& document, DocEntity& e) {
        const std::string wanted(e.get("_external_map"));
        std::string classname(e.get("_external_map_classname"));
        if (classname.empty()) {
            context_.report(Severity::warning, "external-map-class", "a misc_external_map has no _external_map_classname; func_group is used", where(e));
            classname = "func_group";
        }
        std::optional<Placement> placement;
        if (wanted.empty()) context_.report(Severity::warning, "instance-missing", "a misc_external_map names no file; it stays without brushes", where(e));
        else placement = external_placement(e);
        std::optional<Document> part;
        if (placement) part = load(wanted, e, {}, false);
        std::erase_if(e.keys, [](const DocKey& k) { return starts_with_ignoring_case(k.key, "_external_map"); });
        for (DocKey& k : e.keys) {
            if (equal_ignoring_case(k.key, "classname")) k.value = classname;
            else if (equal_ignoring_case(k.key, "origin")) k.value = "0 0 0"; // the brushes stand where they belong
        }
        if (!part) return;
        place_all(*part, *placement);
        DocEntity all;
        for (DocEntity& inner : part->entities) {
            append(all.brushes, inner.brushes);
            append(all.patches, inner.patches);
            e.skipped_primitives += inner.skipped_primitives;
        }
        part->entities.assign(1, std::move(all));
        std::vector<DocEntity> into(1);
        merge(document, into, std::move(*part));
        append(e.brushes, into[0].brushes);
        append(e.patches, into[0].patches);
    }

    std::optional<Placement> external_placement(const DocEntity& e) {
        Placement placement;
        const std::optional<DecimalPoint> origin = numbers_of(e, "origin", "0 0 0", kLargestCoordinate);
        const std::optional<DecimalPoint> angles = numbers_of(e, "_external_map_angles", "0 0 0", kLargestAngle);
        if (!origin || !angles) return std::nullopt;
        Vec3 a = to_vec(*angles);
        if (a == Vec3{}) a.y = e.number("_external_map_angle", 0);
        placement.origin = *origin;
        placement.rotation = matrix_of_angles(a);

        const DocKey* key = e.find("_external_map_scale");
        if (!key || key->value.empty()) return placement;
        DecimalPoint scale;
        std::size_t count = 0;
        bool good = true;
        for (std::size_t at = 0; at < key->value.size();) {
            const std::size_t end = std::min(key->value.find(' ', at), key->value.size());
            if (end > at) {
                const std::optional<Decimal> x = parse_decimal(std::string_view(key->value).substr(at, end - at));
                good = good && x && count < 3 && x->to_double() >= 1e-6 && x->to_double() <= 1e6;
                if (good) scale[count] = *x;
                ++count;
            }
            at = end + 1;
        }
        if (count == 1) scale[1] = scale[2] = scale[0];
        if (!good || (count != 1 && count != 3)) {
            if (parse_number(key->value).value_or(1) != 0) // 0: not set
                context_.report(Severity::warning, "external-map-scale", fmt::format("the scale '{}' is not one or three positive numbers; 1 is used", shown(key->value)), where(e, *key));
            return placement;
        }
        placement.scale = scale;
        return placement;
    }

    // A func_instance_io_proxy passes its input ProxyRelayN on as its output OnProxyRelayN. It is for compilers only: whoever
    // sends to it gets its outputs instead, and it goes.
    void resolve_proxies(Document& document) {
        struct Proxy {
            std::size_t entity = 0;
            std::map<std::string, std::vector<DocKey>> outputs; // by event, lower case
        };
        std::map<std::string, Proxy> proxies;
        for (std::size_t i = 0; i < document.entities.size(); ++i) {
            const DocEntity& e = document.entities[i];
            if (!is_class(e, "func_instance_io_proxy")) continue;
            Proxy& proxy = proxies[lower_case(e.get("targetname"))];
            proxy.entity = i;
            for (const DocKey& k : e.keys)
                if (k.output) proxy.outputs[lower_case(k.key)].push_back(k);
        }
        if (proxies.empty()) return;
        constexpr int kMostRounds = 16; // proxies may send to proxies, in a circle even
        for (DocEntity& e : document.entities) {
            if (is_class(e, "func_instance_io_proxy")) continue;
            for (int round = 0; round < kMostRounds; ++round) {
                bool changed = false;
                std::vector<DocKey> keys;
                for (DocKey& k : e.keys) {
                    const Output sent = k.output ? Output::parse(k.value) : Output{};
                    const auto it = sent.fields.size() > 1 ? proxies.find(lower_case(sent.fields[0])) : proxies.end();
                    if (it == proxies.end() || !starts_with_ignoring_case(sent.fields[1], "ProxyRelay")) {
                        keys.push_back(std::move(k));
                        continue;
                    }
                    changed = true;
                    const auto outputs = it->second.outputs.find("on" + lower_case(sent.fields[1]));
                    if (outputs == it->second.outputs.end()) {
                        context_.report(Severity::note, "instance-output-unknown",
                                        fmt::format("the proxy '{}' passes {} on to nobody: the output has no effect", shown(sent.fields[0]), shown(sent.fields[1])), where(e, k));
                        continue;
                    }
                    for (const DocKey& passed : outputs->second) keys.push_back(joined(k, sent, passed));
                    if (keys.size() > kMostInstances) break;
                }
                e.keys = std::move(keys);
                if (!changed || e.keys.size() > kMostInstances) break;
            }
        }
        std::erase_if(document.entities, [](const DocEntity& e) { return is_class(e, "func_instance_io_proxy"); });
    }
    static DocKey joined(const DocKey& k, const Output& sent, const DocKey& passed) {
        Output out = Output::parse(passed.value);
        out.fields.resize(std::max<std::size_t>(out.fields.size(), 5));
        const auto field = [&](std::size_t i) { return i < sent.fields.size() ? std::string_view(sent.fields[i]) : std::string_view(); };
        if (out.fields[2].empty()) out.fields[2] = field(2);
        out.fields[3] = number_text(parse_number(out.fields[3]).value_or(0) + parse_number(field(3)).value_or(0));
        const double a = parse_number(out.fields[4]).value_or(-1), b = parse_number(field(4)).value_or(-1); // -1: for ever
        out.fields[4] = number_text(a < 0 ? b : b < 0 ? a : std::min(a, b));
        return {k.key, out.text(), k.line, true};
    }
};

} // namespace

// VMF text begins with a word (versioninfo, world, ...); Quake-family text with a brace, a comment or "Version 2".
bool is_vmf(const TextFile& map) {
    const auto& b = map.bytes;
    std::size_t i = b.size() >= 3 && b[0] == 0xEF && b[1] == 0xBB && b[2] == 0xBF ? 3 : 0;
    for (; i < b.size(); ++i) {
        if (std::isspace(b[i])) continue;
        if (b[i] == '/' && i + 1 < b.size() && b[i + 1] == '/') {
            while (i < b.size() && b[i] != '\n') ++i;
            continue;
        }
        const std::string_view text(reinterpret_cast<const char*>(b.data()), b.size());
        const bool doom3 = equal_ignoring_case(text.substr(i, 7), "version") && i + 7 < b.size() && std::isspace(b[i + 7]); // "Version 2"
        return (std::isalpha(b[i]) != 0 && !doom3) || b[i] == '"';
    }
    return map.name.ends_with(".vmf");
}

Result<Document> read_document(const TextFile& map, Context& context) {
    return is_vmf(map) ? read_vmf(map.bytes, map.name, context) : read_quake_map(map.bytes, map.name, context);
}

Result<Document> assemble(const TextFile& map, const OpenMap& open, const AssembleOptions& options, Context& context) {
    Result<Document> document = Assembler(open, context).run(map);
    if (document && options.cordon) cut_to_cordons(*document, context);
    return document;
}

} // namespace kiln
