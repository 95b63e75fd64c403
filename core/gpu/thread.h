// The one thread that owns the one surfaceless EGL context.
//
// Nodes that draw run there, and so does the release of what they hold on the GPU. The thread and
// the context are made at the first use; they need no display and no environment variable.
#pragma once

#include <functional>
#include <string>

namespace voxloom::gpu {

// Runs f on the OpenGL thread with the context current and waits for it; exceptions come back.
// Called on the OpenGL thread itself, runs f at once. Throws Error when there is no OpenGL, saying
// what is missing and how to mend it.
void run(const std::function<void()>& f);

// Queues f and returns at once; f must not throw. Where there is no OpenGL, f runs on the OpenGL
// thread all the same, without a context, and finds out by calling require_context().
void post(std::function<void()> f);

bool on_thread();

// Throws Error when there is no context ("OpenGL: ..."). [OpenGL thread]
void require_context();

// Empty when OpenGL is there, else the reason why not. Makes the context when it is not made yet.
std::string why_unavailable();

struct ContextInfo {
    std::string renderer, version;
    bool software = false;  // llvmpipe or the like: time with glFinish and a CPU clock
    int max_texture_3d = 0;
};
const ContextInfo& context_info();  // throws Error when there is no context

}  // namespace voxloom::gpu
