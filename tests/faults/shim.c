/* Lets one kind of system call fail, of a program that this library is preloaded into (LD_PRELOAD).
 *
 * FAULT        the kind and the error: write:EIO, fsync:EIO, thread:EAGAIN ... (write:SHORT and write:ZERO write less)
 * FAULT_AT     the call that fails, counted from 1
 * FAULT_ALWAYS all calls from that one on fail too
 * FAULT_COUNT  a file to write the number of calls of that kind to, as the program ends
 *
 * Writes count where they go to regular files. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

static char kind[32], error[32];
static long at = 1, count;
static int always;

__attribute__((constructor)) static void begin(void) {
    const char *fault = getenv("FAULT"), *number = getenv("FAULT_AT");
    if (fault) sscanf(fault, "%31[^:]:%31s", kind, error);
    if (number) at = atol(number);
    always = getenv("FAULT_ALWAYS") != NULL;
}

__attribute__((destructor)) static void end(void) {
    const char *path = getenv("FAULT_COUNT");
    FILE *file = path ? fopen(path, "w") : NULL;
    if (!file) return;
    kind[0] = 0; /* this write is none of the program's */
    fprintf(file, "%ld", count);
    fclose(file);
}

static int code(void) {
    static const struct { const char *name; int code; } codes[] = {
        {"EIO", EIO}, {"ENOSPC", ENOSPC}, {"EPIPE", EPIPE}, {"EINTR", EINTR}, {"EAGAIN", EAGAIN},
        {"EPERM", EPERM}, {"EACCES", EACCES}, {"ENOSYS", ENOSYS}, {"ENOMEM", ENOMEM}, {"EDQUOT", EDQUOT},
        {"EMFILE", EMFILE}, {"EINVAL", EINVAL}};
    for (size_t i = 0; i < sizeof codes / sizeof *codes; i++)
        if (!strcmp(codes[i].name, error)) return codes[i].code;
    return 0;
}

/* Whether this call fails. */
static int fails(const char *name) {
    if (strcmp(kind, name)) return 0;
    long n = __sync_add_and_fetch(&count, 1);
    return n == at || (always && n > at);
}

static int regular(int fd) {
    struct stat status;
    return fd > 2 && !fstat(fd, &status) && S_ISREG(status.st_mode);
}

#define NEXT(type, name, ...) \
    static type (*next)(__VA_ARGS__); \
    if (!next) next = (type(*)(__VA_ARGS__))dlsym(RTLD_NEXT, name)
#define FAIL(name) \
    if (fails(name)) { errno = code(); return -1; }

ssize_t write(int fd, const void *bytes, size_t size) {
    NEXT(ssize_t, "write", int, const void *, size_t);
    if (!regular(fd) || !fails("write")) return next(fd, bytes, size);
    if (!strcmp(error, "ZERO")) return 0;
    if (!strcmp(error, "SHORT")) return next(fd, bytes, size > 7 ? 7 : size);
    errno = code();
    return -1;
}
ssize_t writev(int fd, const struct iovec *parts, int size) {
    NEXT(ssize_t, "writev", int, const struct iovec *, int);
    if (!regular(fd) || !fails("write")) return next(fd, parts, size);
    if (!strcmp(error, "ZERO")) return 0;
    if (!strcmp(error, "SHORT")) return next(fd, parts, 1);
    errno = code();
    return -1;
}
ssize_t pwrite64(int fd, const void *bytes, size_t size, off64_t offset) {
    NEXT(ssize_t, "pwrite64", int, const void *, size_t, off64_t);
    if (!regular(fd) || !fails("write")) return next(fd, bytes, size, offset);
    if (!strcmp(error, "ZERO")) return 0;
    if (!strcmp(error, "SHORT")) return next(fd, bytes, size > 7 ? 7 : size, offset);
    errno = code();
    return -1;
}
int fsync(int fd) { NEXT(int, "fsync", int); FAIL("fsync") return next(fd); }
int fdatasync(int fd) { NEXT(int, "fdatasync", int); FAIL("fsync") return next(fd); }
int rename(const char *from, const char *to) {
    NEXT(int, "rename", const char *, const char *); FAIL("rename") return next(from, to);
}
int renameat2(int a, const char *from, int b, const char *to, unsigned flags) {
    NEXT(int, "renameat2", int, const char *, int, const char *, unsigned);
    FAIL("rename") return next(a, from, b, to, flags);
}
int link(const char *from, const char *to) {
    NEXT(int, "link", const char *, const char *); FAIL("link") return next(from, to);
}
int linkat(int a, const char *from, int b, const char *to, int flags) {
    NEXT(int, "linkat", int, const char *, int, const char *, int); FAIL("link") return next(a, from, b, to, flags);
}
int mkdir(const char *path, mode_t mode) {
    NEXT(int, "mkdir", const char *, mode_t); FAIL("mkdir") return next(path, mode);
}
int unlink(const char *path) { NEXT(int, "unlink", const char *); FAIL("unlink") return next(path); }
int ftruncate64(int fd, off64_t size) {
    NEXT(int, "ftruncate64", int, off64_t); FAIL("truncate") return next(fd, size);
}
off64_t lseek64(int fd, off64_t offset, int whence) {
    NEXT(off64_t, "lseek64", int, off64_t, int);
    if (regular(fd)) FAIL("seek")
    return next(fd, offset, whence);
}
int flock(int fd, int operation) { NEXT(int, "flock", int, int); FAIL("lock") return next(fd, operation); }
int open64(const char *path, int flags, ...) {
    NEXT(int, "open64", const char *, int, ...);
    mode_t mode = 0;
    if (flags & (O_CREAT | O_TMPFILE)) {
        __builtin_va_list rest;
        __builtin_va_start(rest, flags);
        mode = __builtin_va_arg(rest, mode_t);
        __builtin_va_end(rest);
    }
    if (flags & (O_WRONLY | O_RDWR)) FAIL("create")
    return next(path, flags, mode);
}
int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*start)(void *), void *argument) {
    NEXT(int, "pthread_create", pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
    return fails("thread") ? code() : next(thread, attributes, start, argument);
}
void *mmap64(void *address, size_t size, int protection, int flags, int fd, off64_t offset) {
    NEXT(void *, "mmap64", void *, size_t, int, int, int, off64_t);
    if (fails("map")) { errno = code(); return MAP_FAILED; }
    return next(address, size, protection, flags, fd, offset);
}
