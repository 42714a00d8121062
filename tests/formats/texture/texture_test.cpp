// WAD, VTF and VMT: made by hand here, read back, cut short and spoiled.
#include "formats/texture/vmt.h"
#include "formats/texture/vtf.h"
#include "formats/texture/wad.h"
#include "libs/image/image.h"
#include <cmath>
#include <cstring>
#include <gtest/gtest.h>
#include <random>

namespace kiln {
namespace {

using Bytes = std::vector<std::uint8_t>;

const WantedTexture all = [](const std::string&) { return true; };

void put(Bytes& b, std::uint64_t v, int size) {
    for (int i = 0; i < size; ++i) b.push_back(i < 8 ? static_cast<std::uint8_t>(v >> 8 * i) : std::uint8_t{0});
}
void put_name(Bytes& b, const std::string& name) {
    for (std::size_t i = 0; i < 16; ++i) b.push_back(i < name.size() ? static_cast<std::uint8_t>(name[i]) : 0);
}
struct Picture {
    std::string name;
    std::uint32_t width, height;
    Bytes texels;
};
Bytes palette_of_greys() {
    Bytes p;
    for (int i = 0; i < 256; ++i) p.insert(p.end(), 3, static_cast<std::uint8_t>(i));
    return p;
}
Bytes wad_of(const std::vector<Picture>& pictures, bool half_life) {
    Bytes out{'W', 'A', 'D', static_cast<std::uint8_t>(half_life ? '3' : '2')}, directory;
    put(out, pictures.size() + 1, 4), put(out, 0, 4);
    const auto list = [&](std::size_t at, std::size_t size, std::uint8_t type, const std::string& name) {
        put(directory, at, 4), put(directory, size, 4), put(directory, size, 4), put(directory, type, 1), put(directory, 0, 3), put_name(directory, name);
    };
    list(12, 0, 0x40, "palette"); // something else
    for (const Picture& p : pictures) {
        const std::size_t at = out.size();
        put_name(out, p.name), put(out, p.width, 4), put(out, p.height, 4);
        std::size_t next = 40;
        for (std::uint32_t m = 0; m < 4; ++m) put(out, next, 4), next += std::size_t{p.width >> m} * (p.height >> m);
        out.insert(out.end(), p.texels.begin(), p.texels.end());
        out.resize(at + next, 7); // smaller sizes
        if (half_life) {
            put(out, 256, 2);
            for (const std::uint8_t c : palette_of_greys()) out.push_back(static_cast<std::uint8_t>(255 - c));
        }
        list(at, out.size() - at, half_life ? 0x43 : 0x44, p.name);
    }
    const std::size_t at = out.size();
    for (int i = 0; i < 4; ++i) out[8 + static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(at >> 8 * i);
    out.insert(out.end(), directory.begin(), directory.end());
    return out;
}
Bytes filled(std::size_t n, std::uint8_t low, std::uint8_t high) { // half of each
    Bytes b(n, low);
    std::fill(b.begin(), b.begin() + static_cast<std::ptrdiff_t>(n / 2), high);
    return b;
}
double linear(int v) { return linear_from_srgb(static_cast<float>(v) / 255.0f); }

TEST(Wad, SizesAndMeanColours) {
    const std::vector<Picture> pictures{{"WALL1", 64, 32, filled(64 * 32, 0, 200)}, {"{fence", 16, 16, filled(256, 255, 80)}, {"{nothing", 16, 16, filled(256, 255, 255)}, {"*lava1", 32, 64, filled(2048, 10, 10)}};
    for (const bool half_life : {false, true}) {
        Context c;
        const auto wad = read_wad(wad_of(pictures, half_life), palette_of_greys(), "x.wad", all, c);
        ASSERT_TRUE(wad);
        EXPECT_EQ(wad->own_palettes, half_life);
        ASSERT_EQ(wad->textures.size(), 4u);
        const auto grey = [&](int i) { return linear(half_life ? 255 - i : i); };
        EXPECT_EQ(wad->textures[0].name, "WALL1");
        EXPECT_EQ(wad->textures[0].width, 64);
        EXPECT_EQ(wad->textures[0].height, 32);
        EXPECT_NEAR(wad->textures[0].mean->x, (grey(0) + grey(200)) / 2, 1e-6);
        EXPECT_NEAR(wad->textures[1].mean->y, grey(80), 1e-6); // holes do not count
        EXPECT_FALSE(wad->textures[2].mean);
        EXPECT_NEAR(wad->textures[3].mean->z, grey(10), 1e-6);
        EXPECT_TRUE(c.diagnostics().empty());
    }
    Context c;
    const auto wad = read_wad(wad_of(pictures, false), {}, "x.wad", all, c); // no palette: no colours
    ASSERT_TRUE(wad);
    EXPECT_EQ(wad->textures[0].width, 64);
    EXPECT_FALSE(wad->textures[0].mean);
}

// An archive holds thousands of textures of which a map names a few: of others nothing is read. Entries may share what they name.
TEST(Wad, OnlyWhatIsWantedIsRead) {
    const std::vector<Picture> pictures{{"wanted", 16, 16, filled(256, 1, 2)}, {"other", 16, 16, filled(256, 3, 4)}};
    Bytes bytes = wad_of(pictures, true);
    const std::size_t directory = std::size_t{bytes[8]} | std::size_t{bytes[9]} << 8 | std::size_t{bytes[10]} << 16;
    Context c;
    const WantedTexture one = [](const std::string& name) { return name == "wanted"; };
    auto wad = read_wad(bytes, {}, "x.wad", one, c);
    ASSERT_TRUE(wad);
    ASSERT_EQ(wad->textures.size(), 1u);
    EXPECT_EQ(wad->textures[0].name, "wanted");
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(directory + 32), 8, bytes.begin() + static_cast<std::ptrdiff_t>(directory + 64)); // the second names the first's
    wad = read_wad(bytes, {}, "x.wad", all, c);
    ASSERT_TRUE(wad);
    ASSERT_EQ(wad->textures.size(), 2u);
    EXPECT_EQ(wad->textures[0].mean->x, wad->textures[1].mean->x);
    // Asking for all of 100,000 such entries of a large texture reads it once: it would not end otherwise.
    Bytes large = wad_of({{"large", 2048, 2048, filled(2048 * 2048, 1, 2)}}, true);
    const std::size_t at = std::size_t{large[8]} | std::size_t{large[9]} << 8 | std::size_t{large[10]} << 16 | std::size_t{large[11]} << 24;
    const Bytes entry(large.begin() + static_cast<std::ptrdiff_t>(at + 32), large.begin() + static_cast<std::ptrdiff_t>(at + 64));
    for (int i = 1; i < 100000; ++i) large.insert(large.end(), entry.begin(), entry.end());
    const std::uint32_t count = 100001; // the palette stands first
    for (int i = 0; i < 4; ++i) large[4 + static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(count >> 8 * i);
    wad = read_wad(large, {}, "x.wad", all, c);
    ASSERT_TRUE(wad);
    EXPECT_EQ(wad->textures.size(), 100000u);
}

TEST(Wad, WhatIsCutShortIsTold) {
    const Bytes good = wad_of({{"a", 16, 16, filled(256, 1, 2)}, {"b", 16, 16, filled(256, 3, 4)}}, true);
    for (std::size_t size = 0; size < good.size(); ++size) { // the directory stands at the end
        Context c;
        const std::vector<std::uint8_t> cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size));
        const auto wad = read_wad(cut, {}, "x.wad", all, c);
        ASSERT_FALSE(wad) << size;
        EXPECT_EQ(wad.fault().diagnostic.code, "texture-unreadable");
        EXPECT_EQ(wad.fault().diagnostic.where.file, "x.wad");
    }
    Bytes bad = good; // the first texture claims to be wide
    bad[12 + 16 + 1] = 0x10;
    Context c;
    const auto wad = read_wad(bad, {}, "x.wad", all, c);
    ASSERT_TRUE(wad);
    ASSERT_EQ(wad->textures.size(), 1u);
    EXPECT_EQ(wad->textures[0].name, "b");
    ASSERT_EQ(c.diagnostics().size(), 1u);
    EXPECT_EQ(c.diagnostics()[0].code, "texture-unreadable");
    EXPECT_NE(c.diagnostics()[0].message.find("'a'"), std::string::npos);
}

TEST(Wad, SpoiledBytesNeverCrash) {
    std::mt19937_64 random(4);
    for (const bool half_life : {false, true}) {
        const Bytes good = wad_of({{"a", 16, 16, filled(256, 1, 2)}, {"{b", 8, 24, filled(192, 3, 255)}}, half_life);
        for (int i = 0; i < 20000; ++i) {
            Bytes bad = good;
            for (int k = 0; k <= i % 4; ++k) { // the heads, mostly
                const std::size_t at = i % 3 == 0 ? random() % bad.size() : i % 3 == 1 ? random() % 64 : bad.size() - 1 - random() % 96;
                bad[at] = static_cast<std::uint8_t>(random());
            }
            if (i % 7 == 0) bad.resize(random() % (bad.size() + 1));
            Context c;
            const auto wad = read_wad(bad, palette_of_greys(), "x.wad", all, c);
            if (!wad) continue;
            for (const WadTexture& t : wad->textures) {
                EXPECT_LE(static_cast<std::size_t>(t.width) * static_cast<std::size_t>(t.height), bad.size());
                EXPECT_TRUE(!t.mean || (t.mean->x >= 0 && t.mean->x <= 1));
            }
        }
    }
}

Bytes vtf_of(std::uint32_t width, std::uint32_t height, float r, float g, float b, std::uint32_t minor = 2) {
    Bytes out{'V', 'T', 'F', 0};
    put(out, 7, 4), put(out, minor, 4), put(out, 80, 4), put(out, width, 2), put(out, height, 2), put(out, 0, 12);
    for (const float v : {r, g, b}) {
        std::uint32_t bits = 0;
        std::memcpy(&bits, &v, 4);
        put(out, bits, 4);
    }
    out.resize(80);
    return out;
}

TEST(Vtf, SizeAndReflectivity) {
    const auto head = read_vtf_head(vtf_of(512, 256, 0.25f, 0.5f, 0.125f), "x.vtf");
    ASSERT_TRUE(head);
    EXPECT_EQ(head->width, 512);
    EXPECT_EQ(head->height, 256);
    EXPECT_EQ(head->reflectivity, (Rgbd{0.25, 0.5, 0.125}));
    const auto odd = read_vtf_head(vtf_of(4, 4, NAN, -3, 7), "x.vtf");
    ASSERT_TRUE(odd);
    EXPECT_EQ(odd->reflectivity, (Rgbd{0, 0, 1}));
    EXPECT_FALSE(read_vtf_head(vtf_of(0, 4, 0, 0, 0), "x.vtf"));
    EXPECT_FALSE(read_vtf_head(vtf_of(4, 4, 0, 0, 0, 9), "x.vtf"));
    const Bytes good = vtf_of(4, 4, 0, 0, 0);
    for (std::size_t size = 0; size < kVtfHeadBytes; ++size) EXPECT_FALSE(read_vtf_head(Bytes(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size)), "x.vtf"));
}

// A texture of `mips` sizes (the smaller ones of zeros) in one of Valve's formats; `parts`: the list that files have from 7.3 on.
Bytes vtf_texels(std::uint32_t format, std::uint32_t width, std::uint32_t height, const Bytes& texels, std::size_t smaller = 0, std::uint32_t mips = 1, bool parts = false, std::uint32_t flags = 0) {
    Bytes out = vtf_of(width, height, 0, 0, 0, parts ? 4 : 2);
    const auto set = [&](std::size_t at, std::uint32_t v, int size) { for (int i = 0; i < size; ++i) out[at + static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(v >> 8 * i); };
    set(20, flags, 4), set(24, 1, 2), set(52, format, 4), set(56, mips, 1), set(57, parts ? 0xFFFFFFFF : 13, 4), set(63, 1, 2);
    if (parts) {
        set(68, 2, 4);
        put(out, 0x01, 4), put(out, 96, 4), put(out, 0x30, 4), put(out, 96, 4);
        set(12, 96, 4);
    } else {
        set(61, 4, 1), set(62, 4, 1), out.resize(80 + 8); // the thumbnail, one block
    }
    out.resize(out.size() + smaller);
    out.insert(out.end(), texels.begin(), texels.end());
    return out;
}
Bytes texel(const TexelPicture& p, std::size_t x, std::size_t y) {
    const auto at = p.rgba.begin() + static_cast<std::ptrdiff_t>(4 * (y * static_cast<std::size_t>(p.width) + x));
    return {at, at + 4};
}

TEST(Vtf, TexelsWithTheirOpacity) {
    const auto read = [](const Bytes& b) {
        const auto p = read_vtf_picture(b, "x.vtf");
        EXPECT_TRUE(p);
        return p ? *p : TexelPicture{};
    };
    // BGRA and RGBA, with smaller sizes before, and the parts of newer files.
    for (const bool parts : {false, true}) {
        const Bytes four{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};
        const TexelPicture bgra = read(vtf_texels(12, 2, 2, four, 4, 2, parts));
        ASSERT_EQ(bgra.rgba.size(), 16u);
        EXPECT_EQ(texel(bgra, 1, 0), (Bytes{7, 6, 5, 8}));
        EXPECT_EQ(texel(read(vtf_texels(0, 2, 2, four, 0, 1, parts)), 0, 1), (Bytes{9, 10, 11, 12}));
    }
    EXPECT_EQ(texel(read(vtf_texels(1, 1, 1, {9, 8, 7, 6})), 0, 0), (Bytes{6, 7, 8, 9}));
    EXPECT_EQ(texel(read(vtf_texels(11, 1, 1, {9, 8, 7, 6})), 0, 0), (Bytes{8, 7, 6, 9}));
    EXPECT_EQ(texel(read(vtf_texels(8, 1, 1, {77})), 0, 0), (Bytes{255, 255, 255, 77}));
    EXPECT_EQ(texel(read(vtf_texels(6, 1, 1, {5, 77})), 0, 0), (Bytes{5, 5, 5, 77}));
    EXPECT_EQ(texel(read(vtf_texels(19, 1, 1, {0x21, 0x43})), 0, 0), (Bytes{51, 34, 17, 68}));
    EXPECT_EQ(texel(read(vtf_texels(21, 1, 1, {0x00, 0xFC})), 0, 0), (Bytes{255, 0, 0, 255}));
    EXPECT_EQ(texel(read(vtf_texels(3, 1, 1, {1, 2, 3})), 0, 0), (Bytes{3, 2, 1, 255}));
    // DXT1: the first colour not above the second, so code 3 is a hole. Texel i of the block has code i % 4.
    const Bytes dxt1{0x00, 0x00, 0xFF, 0xFF, 0xE4, 0xE4, 0xE4, 0xE4};
    const TexelPicture holes = read(vtf_texels(13, 3, 4, dxt1)); // cut off at the right
    EXPECT_EQ(texel(holes, 0, 0), (Bytes{0, 0, 0, 255}));
    EXPECT_EQ(texel(holes, 1, 3), (Bytes{255, 255, 255, 255}));
    EXPECT_EQ(texel(holes, 2, 1), (Bytes{127, 127, 127, 255}));
    EXPECT_EQ(texel(read(vtf_texels(20, 4, 4, dxt1)), 3, 2), (Bytes{0, 0, 0, 0}));
    // DXT3: four bits each. DXT5: two ends and six between.
    Bytes dxt3{0x10, 0x32, 0x54, 0x76, 0x98, 0xBA, 0xDC, 0xFE};
    dxt3.insert(dxt3.end(), {0xFF, 0xFF, 0x00, 0x00, 0, 0, 0, 0});
    const TexelPicture three = read(vtf_texels(14, 4, 4, dxt3));
    for (std::size_t i = 0; i < 16; ++i) EXPECT_EQ(texel(three, i % 4, i / 4), (Bytes{255, 255, 255, static_cast<std::uint8_t>(i * 17)}));
    Bytes dxt5{70, 0, 0x88, 0xC6, 0xFA, 0x88, 0xC6, 0xFA}; // codes 0 1 2 3 4 5 6 7, twice
    dxt5.insert(dxt5.end(), {0xFF, 0xFF, 0x00, 0x00, 0, 0, 0, 0});
    const TexelPicture five = read(vtf_texels(15, 4, 4, dxt5));
    const int expected[] = {70, 0, 60, 50, 40, 30, 20, 10};
    for (std::size_t i = 0; i < 16; ++i) EXPECT_EQ(texel(five, i % 4, i / 4)[3], expected[i % 8]) << i;
    dxt5[0] = 0, dxt5[1] = 50;
    const TexelPicture six = read(vtf_texels(15, 4, 4, dxt5));
    const int other[] = {0, 50, 10, 20, 30, 40, 0, 255};
    for (std::size_t i = 0; i < 16; ++i) EXPECT_EQ(texel(six, i % 4, i / 4)[3], other[i % 8]) << i;
    // Cube maps and floats have none.
    EXPECT_TRUE(read(vtf_texels(0, 1, 1, {1, 2, 3, 4}, 0, 1, false, 0x4000)).empty());
    EXPECT_TRUE(read(vtf_texels(24, 1, 1, {})).empty());
    // Every cut and any byte.
    const Bytes good = vtf_texels(15, 8, 8, Bytes(64, 9), 16 + 16 + 16, 4, true);
    ASSERT_TRUE(read_vtf_picture(good, "x.vtf"));
    for (std::size_t size = 0; size < good.size(); ++size) EXPECT_FALSE(read_vtf_picture(Bytes(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size)), "x.vtf")) << size;
    for (std::size_t at = 0; at < 100; ++at)
        for (const int v : {0, 1, 127, 128, 255}) {
            Bytes spoiled = good;
            spoiled[at] = static_cast<std::uint8_t>(v);
            (void)read_vtf_picture(spoiled, "x.vtf");
        }
}

TEST(Wad, TexelsOfTexturesWithHoles) {
    Context c;
    Bytes texels(16 * 16, 3);
    texels[5] = 255;
    const auto with = read_wad(wad_of({{"{fence", 16, 16, texels}, {"wall", 16, 16, texels}}, true), {}, "x.wad", all, c);
    ASSERT_TRUE(with);
    const TexelPicture& holes = with->textures.at(0).holed;
    ASSERT_EQ(holes.rgba.size(), 4u * 16 * 16);
    EXPECT_EQ(texel(holes, 5, 0), (Bytes{0, 0, 0, 0}));
    EXPECT_EQ(texel(holes, 6, 0), (Bytes{252, 252, 252, 255}));
    EXPECT_TRUE(with->textures.at(1).holed.empty()); // 255 is a colour there
    // Without a palette the holes are known all the same.
    const auto quake = read_wad(wad_of({{"{fence", 16, 16, texels}}, false), {}, "x.wad", all, c);
    ASSERT_TRUE(quake);
    EXPECT_EQ(texel(quake->textures.at(0).holed, 5, 0)[3], 0);
    EXPECT_EQ(texel(quake->textures.at(0).holed, 6, 0)[3], 255);
}

TEST(Vmt, KeysOfTheShaderAlone) {
    const auto vmt = read_vmt("\xEF\xBB\xBF// made by hand\n\"LightmappedGeneric\"\n{\n\t\"$BaseTexture\" \"Brick/Wall01\" // here\n $alpha .5 [$X360]\n $alpha 0.75 [!$X360]\n"
                              "\"%CompileWater\" 1\n\"%compileClip\" \"0\"\nLightmappedGeneric_DX6\n{\n$basetexture other\n}\n\"Proxies\" { \"Sine\" { \"resultVar\" \"$alpha\" } }\n$nocull 1\n}\n", "x.vmt");
    ASSERT_TRUE(vmt);
    EXPECT_EQ(vmt->shader, "lightmappedgeneric");
    ASSERT_TRUE(vmt->find("$basetexture"));
    EXPECT_EQ(*vmt->find("$basetexture"), "Brick/Wall01");
    EXPECT_EQ(*vmt->find("$alpha"), "0.75");
    EXPECT_TRUE(vmt->is_set("%compilewater"));
    EXPECT_FALSE(vmt->is_set("%compileclip"));
    EXPECT_FALSE(vmt->is_set("%compilesky"));
    EXPECT_TRUE(vmt->is_set("$nocull")); // what follows the blocks counts again
    EXPECT_FALSE(vmt->find("resultvar"));
    EXPECT_EQ(vmt->keys.size(), 5u); // $alpha .5 is for another machine
}

TEST(Vmt, ConditionsHoldOnADesktop) {
    const auto value = [](const std::string& lines) {
        const auto vmt = read_vmt("s\n{\n$color \"[1 1 1]\"\n" + lines + "\n}\n", "x.vmt");
        EXPECT_EQ(*vmt->find("$color"), "[1 1 1]"); // no condition, though it looks like one
        const std::string* found = vmt->find("$a");
        return found ? *found : std::string("none");
    };
    for (const char* here : {"[$WIN32]", "[$windows]", "[!$X360]", "[!$PS3&&$WIN32]", "[$X360||$WIN32]", "[! $X360 ]", "[$X360 || $WIN32]", "[$SOMETHING]"}) EXPECT_EQ(value(std::string("$a 1 ") + here + " $b 2"), "1") << here;
    for (const char* elsewhere : {"[$X360]", "[!$WIN32]", "[$PS3||$X360]", "[$WIN32&&$X360]", "[!$PS3 && $X360]", "[$OSX]"}) EXPECT_EQ(value(std::string("$a 1 ") + elsewhere), "none") << elsewhere;
    EXPECT_EQ(value("$a 1 [$WIN32]\n$a 2 [$X360]"), "1");
    EXPECT_EQ(value("\"%compilesky\" 1 [$X360]\n$a 3"), "3");
    const auto patch = read_vmt("patch { include a.vmt insert [$X360] { $a 1 } replace [!$X360] { $b 2 } }", "x.vmt");
    EXPECT_FALSE(patch->find("$a"));
    EXPECT_TRUE(patch->find("$b"));
    EXPECT_EQ(read_vmt("patch { include a.vmt [$X360] include b.vmt [!$X360] }", "x.vmt")->include, "b.vmt");
    EXPECT_EQ(*read_vmt("s { $a 1 [$X360 || $WIN32] $b 2 }", "x.vmt")->find("$b"), "2");
    EXPECT_FALSE(read_vmt("s { $a 1 [$X360 }", "x.vmt"));
}

TEST(Vmt, PatchesNameWhatTheyPatch) {
    const auto vmt = read_vmt("patch { include \"materials/a\\b.vmt\" insert { $alpha 0.5 } replace { $basetexture c } other { $nocull 1 } }", "x.vmt");
    ASSERT_TRUE(vmt);
    EXPECT_EQ(vmt->include, "materials/a\\b.vmt");
    EXPECT_EQ(vmt->keys.size(), 2u);
    EXPECT_EQ(*vmt->find("$basetexture"), "c");
    EXPECT_FALSE(vmt->find("$nocull"));
}

TEST(Vmt, AnyTextIsReadOrRefused) {
    for (const char* text : {"", "   // nothing", "{", "}", "shader", "shader key", "\"", "{}"}) EXPECT_FALSE(read_vmt(text, "x.vmt")) << text;
    for (const char* text : {"s {", "s { a", "s { a b", "s { { { {", "s { } } } }", "s { a { b c } d e", "s { \"a\" \"b"}) EXPECT_TRUE(read_vmt(text, "x.vmt")) << text;
    std::mt19937_64 random(8);
    const std::string alphabet = "{}\"\n[] /$%ab1.";
    for (int i = 0; i < 20000; ++i) {
        std::string text = i % 2 ? "s{" : "patch{";
        for (std::uint64_t n = random() % 60; n-- > 0;) text += alphabet[random() % alphabet.size()];
        (void)read_vmt(text, "x.vmt");
    }
    EXPECT_TRUE(read_vmt("s " + std::string(1000000, '{'), "x.vmt")); // no recursion to run out of
}

} // namespace
} // namespace kiln
