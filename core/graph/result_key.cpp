#include "core/graph/result_key.h"

#include <sys/stat.h>

#include <algorithm>
#include <map>

namespace voxloom {

namespace fs = std::filesystem;

namespace {

void hash_status(const fs::path& path, Hasher& hasher) {
    hasher.text(path.string());
    struct stat status {};
    if (stat(path.c_str(), &status) != 0) {
        hasher.text("missing");
        return;
    }
    hasher.value(std::int64_t(status.st_size));
    hasher.value(std::int64_t(status.st_mtim.tv_sec)).value(std::int64_t(status.st_mtim.tv_nsec));
    hasher.value(std::uint64_t(status.st_ino));
}

// A file by its status; a folder by those of everything directly in it.
Hash fingerprint(const fs::path& path) {
    Hasher hasher;
    hash_status(path, hasher);
    std::error_code ignored;
    if (fs::is_directory(path, ignored)) {
        std::vector<fs::path> entries;
        for (const auto& entry : fs::directory_iterator(path, ignored)) entries.push_back(entry.path());
        std::sort(entries.begin(), entries.end());
        for (const fs::path& entry : entries) hash_status(entry, hasher);
    }
    return hasher.finish();
}

}  // namespace

std::vector<Hash> result_keys(const Plan& plan) {
    std::map<fs::path, Hash> fingerprints;
    auto add_file = [&](const fs::path& path, Hasher& hasher) {
        auto [it, is_new] = fingerprints.try_emplace(path);
        if (is_new) it->second = fingerprint(path);
        hasher.hash(it->second);
    };

    std::vector<Hash> keys(plan.nodes.size());
    for (std::size_t i = 0; i < plan.nodes.size(); ++i) {
        const Plan::Node& node = plan.nodes[i];
        Hasher hasher;
        if (!node.ok) {
            keys[i] = hasher.text("not ok").value(std::uint64_t(i)).finish();
            continue;
        }
        hasher.text(node.type->id).value(node.type->version);
        node.params.hash_into(hasher);
        for (const auto& sources : node.inputs) {
            hasher.value(std::uint64_t(sources.size()));
            for (const Plan::Source& source : sources)
                hasher.hash(keys[std::size_t(source.node)]).value(source.output);
        }
        for (const ParamSpec& spec : node.type->params)
            if (spec.kind == ParamKind::path_in && !node.params.text(spec.key).empty())
                add_file(node.params.path(spec.key), hasher);
        if (node.type->files)
            for (const fs::path& file : node.type->files(node.params)) add_file(file, hasher);
        keys[i] = hasher.finish();
    }
    return keys;
}

}  // namespace voxloom
