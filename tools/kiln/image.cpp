#include "libs/core/file.h"
#include "libs/image/image.h"
#include "tools/kiln/commands.h"
#include "tools/kiln/level_file.h"
#include "tools/render/render.h"
#include <charconv>
#include <filesystem>
#include <fmt/format.h>

namespace kiln {
namespace {

struct ImageOptions {
    std::string level, output, view, show = "shaded", false_colour, atlas;
    std::vector<double> eye, look, size, angles, vis;
    std::vector<std::string> materials_dirs;
    double fov = 90, plan = NAN, exposure = 0;
    int samples = 4, threads = 0;
    bool plan_given = false, fov_given = false, all = false, quiet = false, no_normal_maps = false;
};

const std::vector<std::pair<std::string, Show>> kShows = {
    {"shaded", Show::shaded}, {"irradiance", Show::irradiance}, {"flat", Show::flat}, {"albedo", Show::albedo}, {"normals", Show::normals},
    {"reflection", Show::reflection}, {"luxels", Show::luxels}, {"error", Show::error}, {"validity", Show::validity}, {"faces", Show::faces},
    {"clusters", Show::clusters}, {"probes", Show::probes}};
const std::vector<std::pair<std::string, FalseColour>> kFalseColours = {
    {"density", FalseColour::luxel_density}, {"error", FalseColour::error}, {"validity", FalseColour::validity}};
// What the colours of error_colour (tools/render/colours.h) stand for.
const std::string kErrorKey = "noise of the light gathered at each luxel, relative: dark violet 0.1 % and less, blue 0.6, teal 3.2, green 18, yellow 100; grey: unknown, black: not baked";
template <class T> std::vector<std::string> names(const std::vector<std::pair<std::string, T>>& table) {
    std::vector<std::string> out;
    for (const auto& [name, value] : table) out.push_back(name);
    return out;
}
template <class T> T lookup(const std::vector<std::pair<std::string, T>>& table, const std::string& name) {
    for (const auto& [n, value] : table)
        if (n == name) return value;
    return table.front().second;
}

std::vector<double> numbers(const char* text) {
    std::vector<double> out;
    for (const char* p = text ? text : ""; *p;) {
        char* end = nullptr;
        const double v = std::strtod(p, &end);
        if (end == p) break;
        out.push_back(v);
        p = end;
    }
    return out;
}

// Views drawn into the map: entities info_camera_view with origin, angles (pitch yaw roll), fov and targetname.
struct NamedView { std::string name; Camera camera; };
std::vector<NamedView> views_of(const kiln_level* level) {
    std::vector<NamedView> views;
    kiln_info info{};
    if (kiln_level_info(level, &info) != KILN_OK) return views;
    for (std::uint32_t e = 0; e < info.entities; ++e) {
        const char* name = kiln_level_entity_value(level, e, "classname");
        if (!name || std::string_view(name) != "info_camera_view") continue;
        const auto at = numbers(kiln_level_entity_value(level, e, "origin")), angles = numbers(kiln_level_entity_value(level, e, "angles")),
                   fov = numbers(kiln_level_entity_value(level, e, "fov"));
        if (at.size() < 3) continue;
        const char* target = kiln_level_entity_value(level, e, "targetname");
        Camera c;
        c.eye = {at[0], at[1], at[2]};
        if (angles.size() >= 2) c.pitch_deg = angles[0], c.yaw_deg = angles[1];
        if (!fov.empty() && fov[0] > 1 && fov[0] < 170) c.fov_deg = fov[0];
        views.push_back({target ? target : std::to_string(views.size()), c});
    }
    return views;
}

// A view's name comes from the map; only its harmless characters become part of a file's name.
std::string file_name_of(std::string name) {
    for (char& c : name)
        if (!std::isalnum(static_cast<unsigned char>(c)) && c != '-' && c != '_') c = '_';
    return name.substr(0, 64);
}

Result<bool> write_picture(const std::string& path, const Image& image, bool radiance, double exposure) {
    if (lower_case(path).ends_with(".exr")) return write_exr(path, image);
    return write_png(path, radiance ? tone_mapped(image, exposure) : image, Transfer::srgb);
}

class Painter {
public:
    Painter(const ImageOptions& options, const kiln_level* level, Console& console, Context& context) : o_(options), level_(level), console_(console), context_(context) {}

    int camera(const Camera& camera, Show show, const std::string& path) {
        CameraOptions c;
        if (o_.size.size() == 2) c.width = static_cast<int>(o_.size[0]), c.height = static_cast<int>(o_.size[1]);
        c.samples = o_.samples;
        c.show = show;
        c.normal_maps = !o_.no_normal_maps;
        c.texture_directories = o_.materials_dirs;
        c.texture_directories.push_back(std::filesystem::absolute(o_.level).parent_path().string());
        const bool radiance = show == Show::shaded || show == Show::irradiance || show == Show::flat || show == Show::reflection;
        return save(render_camera(level_, camera, c, context_), radiance, path, show == Show::error ? kErrorKey : "");
    }
    int save(const Result<Image>& image, bool radiance, const std::string& path, const std::string& key = {}) {
        console_.print_new(context_);
        if (!image) return console_.fail(image.fault());
        if (const auto written = write_picture(path, *image, radiance, o_.exposure); !written) return console_.fail(written.fault());
        console_.say(path);
        if (!key.empty()) console_.say(key);
        return 0;
    }
    Camera chosen_camera(int& code) {
        Camera c = default_camera(level_);
        const auto views = views_of(level_);
        if (!o_.view.empty()) {
            bool found = false;
            for (std::size_t i = 0; i < views.size(); ++i)
                if (views[i].name == o_.view || std::to_string(i) == o_.view) c = views[i].camera, found = true;
            if (found && o_.fov_given) c.fov_deg = o_.fov;
            if (!found) {
                std::string known;
                for (const NamedView& v : views) known += " " + v.name;
                code = console_.fail(fault(Exit::usage, "usage", fmt::format("the level has no view \"{}\"; it has:{}", o_.view, known.empty() ? " none" : known), {.file = o_.level}));
            }
        } else if (o_.eye.empty() && !views.empty()) {
            c = views[0].camera;
        }
        if (o_.eye.size() == 3) {
            c.eye = {o_.eye[0], o_.eye[1], o_.eye[2]};
            c.fov_deg = o_.fov;
        }
        if (o_.look.size() == 3) c = camera_looking_at(c.eye, {o_.look[0], o_.look[1], o_.look[2]}, o_.fov);
        if (o_.angles.size() == 2) c.pitch_deg = o_.angles[0], c.yaw_deg = o_.angles[1];
        return c;
    }
    // The set of pictures a bake leaves beside its level.
    int everything() {
        const std::string stem = stem_of(o_.level);
        int code = 0;
        const auto then = [&](int c) { code = code ? code : c; };
        const auto views = views_of(level_);
        if (views.empty()) then(camera(default_camera(level_), Show::shaded, stem + ".view.png"));
        for (const NamedView& v : views) then(camera(v.camera, Show::shaded, stem + ".view_" + file_name_of(v.name) + ".png"));
        const Camera first = views.empty() ? default_camera(level_) : views[0].camera;
        then(camera(first, Show::irradiance, stem + ".irradiance.png"));
        then(camera(first, Show::luxels, stem + ".luxels.png"));
        then(save(render_atlas(level_, -1), true, stem + ".atlas_flat.png"));
        for (int layer = 0; layer < 3; ++layer) then(save(render_atlas(level_, layer), true, stem + fmt::format(".atlas_b{}.png", layer)));
        then(save(render_false_colour(level_, FalseColour::luxel_density), false, stem + ".density.png"));
        kiln_info info{};
        if (kiln_level_info(level_, &info) == KILN_OK && !info.stripped) {
            then(save(render_false_colour(level_, FalseColour::error), false, stem + ".error.png"));
            then(save(render_false_colour(level_, FalseColour::validity), false, stem + ".validity.png"));
        }
        then(save(render_plan(level_, default_plan_height(level_)), false, stem + ".plan.png"));
        return code;
    }

private:
    const ImageOptions& o_;
    const kiln_level* level_;
    Console& console_;
    Context& context_;
};

} // namespace

Command image_command(CLI::App& app) {
    auto o = std::make_shared<ImageOptions>();
    const CLI::Range place(-1e6, 1e6); // map units, or degrees; no nan
    app.add_option("level", o->level, "The level file")->required();
    app.add_option("-o,--output", o->output, "Picture: .png (tone mapped) or .exr (linear); default: beside the level")->type_name("FILE");
    auto* camera = app.add_option_group("Camera view (the default)");
    camera->add_option("--view", o->view, "An info_camera_view entity of the map, by name or number")->type_name("NAME");
    camera->add_option("--eye", o->eye, "Where the camera stands")->expected(3)->check(place)->type_name("X Y Z");
    camera->add_option("--look-at", o->look, "What it looks at")->expected(3)->check(place)->type_name("X Y Z");
    camera->add_option("--angles", o->angles, "Which way it looks, degrees")->expected(2)->check(place)->type_name("PITCH YAW");
    camera->add_option_function<double>("--fov", [o](double f) { o->fov = f, o->fov_given = true; }, "Horizontal field of view, degrees (default 90)")->check(CLI::Range(1.0, 170.0));
    camera->add_option("--size", o->size, "Pixels (default 1280 720)")->expected(2)->check(CLI::Range(1, 16384))->type_name("W H");
    camera->add_option("--samples", o->samples, "Rays a pixel (default 4)")->check(CLI::Range(1, 64));
    camera->add_option("--show", o->show, "shaded, irradiance, flat, albedo, normals, reflection, luxels, error, validity, faces, clusters, probes")->check(CLI::IsMember(names(kShows)));
    camera->add_option("--exposure", o->exposure, "Factor before tone mapping (default: automatic)");
    camera->add_option("--materials-dir", o->materials_dirs, "Folders of the textures that materials name")->type_name("DIR");
    camera->add_flag("--no-normal-maps", o->no_normal_maps, "Flat surfaces");
    auto* other = app.add_option_group("Other pictures");
    other->add_option("--atlas", o->atlas, "Lightmap pages of a basis direction: 0, 1, 2 or flat")->check(CLI::IsMember({"0", "1", "2", "flat"}));
    other->add_option("--false-colour,--false-color", o->false_colour, "Lightmap pages coloured by density, error or validity")->check(CLI::IsMember(names(kFalseColours)));
    other->add_flag_callback("--error", [o] { o->false_colour = "error"; }, "The same as --false-colour error: " + kErrorKey + ". Only the noise of gathered rays has a place; what else the bake knows of its error is in `kiln info` and reports");
    other->add_option_function<double>("--plan", [o](double z) { o->plan = z, o->plan_given = true; }, "Leaves and portals cut at this height")->check(place)->type_name("Z");
    other->add_option("--vis", o->vis, "A plan of what may be seen from this point: its cluster yellow, what that sees green, what that sees in turn blue; cut at the point's height, or at --plan")->expected(3)->check(place)->type_name("X Y Z");
    other->add_flag("--all", o->all, "A set of pictures beside the level");
    app.add_option("--threads", o->threads, "Worker threads (default: all)")->check(CLI::Range(0, 1024));
    app.add_flag("-q,--quiet", o->quiet, "Only warnings and errors");
    app.footer("examples:\n  kiln image atrium.kiln --view hall -o hall.png\n  kiln image m.kiln --eye 0 0 64 --look-at 100 0 64 --show irradiance -o light.exr\n"
               "  kiln image m.kiln --vis 64 -128 24              what may be seen from there\n  kiln image m.kiln --atlas 0 -o b0.png\n  kiln image m.kiln --error                      where the light is how noisy\n  kiln image m.kiln --all");
    return [o]() -> int {
        Console console;
        console.quiet = o->quiet;
        BakeOptions threads;
        threads.threads = o->threads;
        Context context = console.make_context(threads.thread_count());
        const auto file = open_level(o->level);
        if (!file) return console.fail(file.fault());
        const auto& level = file->level;
        Painter painter(*o, level.get(), console, context);
        if (same_file(o->output, o->level)) return console.fail(fault(Exit::usage, "usage", "the output is the level itself", {.file = o->output}));
        if (!o->output.empty() && !lower_case(o->output).ends_with(".png") && !lower_case(o->output).ends_with(".exr"))
            return console.fail(fault(Exit::usage, "usage", "pictures are .png or .exr", {.file = o->output}));
        if (o->all) return painter.everything();
        const auto path = [&](const std::string& what) { return o->output.empty() ? stem_of(o->level) + "." + what + ".png" : o->output; };
        if (!o->atlas.empty())
            return painter.save(render_atlas(level.get(), o->atlas == "flat" ? -1 : o->atlas[0] - '0'), true, path("atlas_" + o->atlas));
        if (!o->false_colour.empty())
            return painter.save(render_false_colour(level.get(), lookup(kFalseColours, o->false_colour)), false, path(o->false_colour), o->false_colour == "error" ? kErrorKey : "");
        if (o->vis.size() == 3) {
            const std::uint32_t leaf = kiln_level_find_leaf(level.get(), o->vis.data());
            std::size_t leaves = 0;
            const kiln_leaf* table = kiln_level_leaves(level.get(), &leaves);
            if (!table || leaf >= leaves || table[leaf].cluster < 0)
                return console.fail(fault(Exit::usage, "usage", fmt::format("the point {:g} {:g} {:g} is in no cluster: solid, or outside", o->vis[0], o->vis[1], o->vis[2]), {.file = o->level}));
            PlanOptions plan;
            plan.vis_from = table[leaf].cluster;
            return painter.save(render_plan(level.get(), o->plan_given ? o->plan : o->vis[2], plan), false, path("vis"));
        }
        if (o->plan_given) return painter.save(render_plan(level.get(), o->plan), false, path("plan"));
        int code = 0;
        const Camera camera_used = painter.chosen_camera(code);
        return code ? code : painter.camera(camera_used, lookup(kShows, o->show), path(o->show));
    };
}

} // namespace kiln
