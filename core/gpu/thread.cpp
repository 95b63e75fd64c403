#include "core/gpu/thread.h"

#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <exception>
#include <future>
#include <mutex>
#include <thread>

#include "core/base/error.h"
#include "core/base/meter.h"

#ifdef VOXLOOM_OPENGL
#include <epoxy/egl.h>
#include <epoxy/gl.h>
#endif

namespace voxloom::gpu {

namespace {

// The context itself. Made, used and destroyed on the OpenGL thread alone.
class Context {
  public:
    Context() = default;
    Context(const Context&) = delete;
    Context& operator=(const Context&) = delete;
    ~Context() { close(); }

    // Empty on success, else why there is none.
    std::string open();
    void close();
    ContextInfo info;

#ifdef VOXLOOM_OPENGL
  private:
    // The first platform that answers: Mesa's surfaceless one needs no device node and no display;
    // a vendor's driver offers its devices.
    bool open_display();
    EGLDisplay display_ = EGL_NO_DISPLAY;
    EGLContext context_ = EGL_NO_CONTEXT;
#endif
};

#ifdef VOXLOOM_OPENGL

bool has_word(const char* words, const char* word) {
    if (!words) return false;
    const std::size_t n = std::strlen(word);
    for (const char* p = words; (p = std::strstr(p, word)); p += n)
        if ((p == words || p[-1] == ' ') && (p[n] == 0 || p[n] == ' ')) return true;
    return false;
}

bool Context::open_display() {
    const char* client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
    auto starts = [this](EGLDisplay display) {
        if (display == EGL_NO_DISPLAY || !eglInitialize(display, nullptr, nullptr)) return false;
        display_ = display;
        return true;
    };
    if (has_word(client, "EGL_EXT_device_enumeration") && has_word(client, "EGL_EXT_platform_device")) {
        // Real devices first; Mesa's software device is what the surfaceless platform gives anyway.
        EGLDeviceEXT devices[16];
        EGLint count = 0;
        if (eglQueryDevicesEXT(16, devices, &count))
            for (int i = 0; i < count; ++i) {
                const char* words = eglQueryDeviceStringEXT(devices[i], EGL_EXTENSIONS);
                if (has_word(words, "EGL_MESA_device_software")) continue;
                if (starts(eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, devices[i], nullptr)))
                    return true;
            }
    }
    return has_word(client, "EGL_MESA_platform_surfaceless") &&
           starts(eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr));
}

std::string Context::open() {
    // The seam by which tests, and people who look for a fault, take OpenGL away.
    if (const char* off = std::getenv("VOXLOOM_NO_OPENGL"); off && *off && std::strcmp(off, "0") != 0)
        return "OpenGL: switched off by the environment variable VOXLOOM_NO_OPENGL; unset it";
    if (!open_display())
        return "OpenGL: EGL offers no display without a screen (EGL_MESA_platform_surfaceless or "
               "EGL_EXT_platform_device); install libegl1 and libgl1-mesa-dri, or a GPU driver";
    if (!has_word(eglQueryString(display_, EGL_EXTENSIONS), "EGL_KHR_surfaceless_context") ||
        !eglBindAPI(EGL_OPENGL_API)) {
        close();
        return "OpenGL: this EGL driver has no contexts without a surface (EGL_KHR_surfaceless_context); "
               "install libgl1-mesa-dri";
    }
    const EGLint wanted[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_SURFACE_TYPE, 0, EGL_NONE};
    EGLConfig config = nullptr;
    EGLint count = 0;
    if (!eglChooseConfig(display_, wanted, &config, 1, &count) || count == 0) config = nullptr;
    const EGLint version[] = {EGL_CONTEXT_MAJOR_VERSION, 4, EGL_CONTEXT_MINOR_VERSION, 5,
                              EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                              EGL_CONTEXT_OPENGL_DEBUG, EGL_TRUE, EGL_NONE};
    context_ = eglCreateContext(display_, config, EGL_NO_CONTEXT, version);
    if (context_ == EGL_NO_CONTEXT ||
        !eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_)) {
        close();
        return "OpenGL: the driver gives no OpenGL 4.5 core context; update the driver or install "
               "libgl1-mesa-dri for drawing in software";
    }
    auto text = [](GLenum name) {
        auto s = reinterpret_cast<const char*>(glGetString(name));
        return std::string(s ? s : "");
    };
    info.renderer = text(GL_RENDERER);
    info.version = text(GL_VERSION);
    info.software = info.renderer.find("llvmpipe") != std::string::npos ||
                    info.renderer.find("softpipe") != std::string::npos ||
                    info.renderer.find("SWR") != std::string::npos;
    glGetIntegerv(GL_MAX_3D_TEXTURE_SIZE, &info.max_texture_3d);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glEnable(GL_DEBUG_OUTPUT);
    glEnable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
    return {};
}

void Context::close() {
    if (display_ == EGL_NO_DISPLAY) return;
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    if (context_ != EGL_NO_CONTEXT) eglDestroyContext(display_, context_);
    eglTerminate(display_);
    eglReleaseThread();
    context_ = EGL_NO_CONTEXT;
    display_ = EGL_NO_DISPLAY;
}

#else

std::string Context::open() {
    return "OpenGL: this program was built without OpenGL; configure it with VOXLOOM_OPENGL=ON";
}
void Context::close() {}

#endif

thread_local bool on_gl_thread = false;

class Thread {
  public:
    // Never destroyed: objects of static lifetime may still hand their release to it.
    static Thread& instance() {
        static Thread* thread = [] {
            std::atexit([] { instance().end(); });
            return new Thread;
        }();
        return *thread;
    }

    Thread() : thread_([this] { loop(); }) {}
    Thread(const Thread&) = delete;
    Thread& operator=(const Thread&) = delete;

    // Works off what is queued, closes the context and joins. [main thread, at exit]
    void end() {
        {
            std::lock_guard lock(mutex_);
            ending_ = true;
        }
        wake_.notify_one();
        if (thread_.joinable()) thread_.join();
    }

    // False when the thread has ended: then nothing on the GPU is left to work on.
    bool queue(std::function<void()> f) {
        {
            std::lock_guard lock(mutex_);
            if (ended_) return false;
            jobs_.push_back(std::move(f));
        }
        wake_.notify_one();
        return true;
    }

    // [OpenGL thread] The context is made at the first need, so that a program that draws nothing
    // loads no driver.
    const std::string& reason() {
        if (!tried_) {
            tried_ = true;
            reason_ = context_->open();
            // The driver registered its own clean-up when it was loaded; handlers run last in, first
            // out, so this one closes the context while the driver is still whole.
            if (reason_.empty()) std::atexit([] { instance().end(); });
        }
        return reason_;
    }
    const ContextInfo& info() const { return context_->info; }

  private:
    void loop() {
        on_gl_thread = true;
        Context context;
        context_ = &context;
        std::unique_lock lock(mutex_);
        for (;;) {
            wake_.wait(lock, [this] { return ending_ || !jobs_.empty(); });
            if (jobs_.empty()) break;
            std::function<void()> job = std::move(jobs_.front());
            jobs_.pop_front();
            lock.unlock();
            job();
            job = nullptr;  // what it holds dies here, outside of the lock
            lock.lock();
        }
        ended_ = true;
    }

    std::mutex mutex_;
    std::condition_variable wake_;
    std::deque<std::function<void()>> jobs_;
    bool ending_ = false, ended_ = false;
    bool tried_ = false;
    std::string reason_;
    Context* context_ = nullptr;
    std::thread thread_;  // last: it starts when everything else is there
};

}  // namespace

bool on_thread() { return on_gl_thread; }

void post(std::function<void()> f) { Thread::instance().queue(std::move(f)); }

void require_context() {
    if (const std::string& reason = Thread::instance().reason(); !reason.empty()) throw Error(reason);
}

void run(const std::function<void()>& f) {
    if (on_gl_thread) {
        require_context();
        f();
        return;
    }
    std::promise<void> done;
    std::future<void> result = done.get_future();
    Meter* meter = Meter::current();
    bool queued = Thread::instance().queue([&] {
        try {
            MeterScope charge(meter);
            require_context();
            f();
            done.set_value();
        } catch (...) {
            done.set_exception(std::current_exception());
        }
    });
    if (!queued) fail("OpenGL: the program is ending, nothing can be drawn any more");
    result.get();
}

std::string why_unavailable() {
    std::string reason;
    auto ask = [&] { reason = Thread::instance().reason(); };
    if (on_gl_thread) {
        ask();
        return reason;
    }
    std::promise<void> done;
    if (!Thread::instance().queue([&] {
            ask();
            done.set_value();
        }))
        return "OpenGL: the program is ending";
    done.get_future().get();
    return reason;
}

const ContextInfo& context_info() {
    if (std::string reason = why_unavailable(); !reason.empty()) throw Error(reason);
    return Thread::instance().info();
}

}  // namespace voxloom::gpu
