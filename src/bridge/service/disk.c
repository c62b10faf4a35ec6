/* SPDX-License-Identifier: Apache-2.0 */
#include "service/disk.h"

#include "drivebridge/config.h"
#include "service/service_private.h"
#include "upgrade/upgrade.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define LOOK_EVERY_NS 500000000L
#define SECOND_NS 1000000000L
/* Checks for an upgrade every fifth second. */
#define LOOKS_PER_UPGRADE 10

struct disk {
	char *path;
	char *copy_path; /* null: none are kept */
	char *written_to;
	int fd;
	pthread_t thread;
	pthread_mutex_t lock; /* of what follows */
	pthread_cond_t wake;
	bool ending;
	char *copy;           /* copy to be written; null: none */
	struct disk_job *job; /* to be worked on; null: none */
	uint64_t expected;    /* signature of the files that the owner knows */
	unsigned turn;        /* number of times it was set */
	uint64_t seen;        /* signature found last */
	char *profiles;       /* profiles that the files named when last read; the thread's own */
	unsigned looks;       /* checks until the next one for an upgrade; the thread's own */
	bool replaced;        /* its result: something was replaced, which was reported */
	bool has_news;
	struct disk_news news;
};

/* --- the copy --------------------------------------------------------------------------------- */

/* Avoids writing the same content again and again, which wears out a flash memory. */
static bool is_there(const char *path, const char *text, size_t length)
{
	FILE *file = fopen(path, "re");
	bool same = true;
	char part[4096];

	if (!file)
		return false;
	for (size_t at = 0; same && at < length; at += sizeof(part)) {
		size_t size = length - at < sizeof(part) ? length - at : sizeof(part);

		same = fread(part, 1, size, file) == size && memcmp(part, text + at, size) == 0;
	}
	same = same && fgetc(file) == EOF;
	fclose(file);
	return same;
}

static bool write_all(int fd, const char *text, size_t length)
{
	while (length > 0) {
		ssize_t written = write(fd, text, length);

		if (written < 0)
			return false;
		text += written;
		length -= (size_t)written;
	}
	/* Readable by its group only; and it is on the disk before it gets the name. */
	return fchmod(fd, S_IRUSR | S_IWUSR | S_IRGRP) == 0 && fsync(fd) == 0;
}

/* The old file stays until the new one is complete. */
int disk_replace_file(const char *path, const char *written_to, const char *text)
{
	const char *slash = strrchr(path, '/');
	size_t length = strlen(text);
	char folder[PATH_MAX];
	int error;
	int fd;

	if (is_there(path, text, length))
		return 0;
	fd = open(written_to, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC,
	          S_IRUSR | S_IWUSR);
	if (fd < 0)
		return errno;
	error = write_all(fd, text, length) ? 0 : errno;
	if (close(fd) != 0 && error == 0)
		error = errno;
	if (error == 0 && rename(written_to, path) != 0)
		error = errno;
	if (error != 0)
		return error;
	/* Ensures that the name outlives a loss of power, too. */
	snprintf(folder, sizeof(folder), "%.*s", slash ? (int)(slash - path + 1) : 1,
	         slash ? path : ".");
	fd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
	if (fd < 0 || fsync(fd) != 0)
		error = errno;
	if (fd >= 0)
		close(fd);
	return error;
}

/* --- the thread ------------------------------------------------------------------------------- */

static void give_news(struct disk *disk, const struct disk_news *news)
{
	disk->news = *news;
	disk->has_news = true;
	(void)eventfd_write(disk->fd, 1);
}

/* The lock is held before and after. Files that change between two checks may still be being
 * written. */
static void look_at_files(struct disk *disk)
{
	struct disk_news news = { 0 };
	struct db_config_reading reading;
	unsigned turn = disk->turn;
	uint64_t signature;
	size_t size = 0;
	FILE *errors;
	bool same;

	pthread_mutex_unlock(&disk->lock);
	signature = db_config_signature(disk->path, disk->profiles);
	pthread_mutex_lock(&disk->lock);
	same = signature == disk->seen;
	disk->seen = signature;
	if (!same || signature == disk->expected || disk->turn != turn)
		return;
	pthread_mutex_unlock(&disk->lock);
	/* The signature of the files read; 0: they changed meanwhile. */
	signature = 0;
	errors = open_memstream(&news.messages, &size);
	if (errors) {
		news.read = true;
		(void)db_config_read(disk->path, NULL, errors, &reading);
		fclose(errors);
		news.config = reading.config;
		free(reading.copy);
		free(disk->profiles);
		disk->profiles = reading.profiles;
		if (db_config_signature(disk->path, disk->profiles) == reading.signature)
			signature = reading.signature;
	}
	pthread_mutex_lock(&disk->lock);
	/* From now on a change of the profiles is seen. */
	if (signature != 0)
		disk->seen = signature;
	if (signature != 0 && disk->turn == turn && !disk->ending) {
		disk->expected = signature;
		give_news(disk, &news);
	} else {
		db_config_free(news.config);
		free(news.messages);
	}
}

/* The lock is held before and after. True when there is something to report. */
static bool look_for_upgrade(struct disk *disk)
{
	struct disk_news news = { 0 };

	if (disk->replaced || disk->looks++ % LOOKS_PER_UPGRADE != 0)
		return false;
	pthread_mutex_unlock(&disk->lock);
	news.newer = db_upgrade_look();
	pthread_mutex_lock(&disk->lock);
	if (!news.newer || disk->has_news || disk->ending) {
		free(news.newer);
		return false;
	}
	disk->replaced = true;
	give_news(disk, &news);
	return true;
}

static void wait_for_work(struct disk *disk)
{
	struct timespec until;

	clock_gettime(CLOCK_MONOTONIC, &until);
	until.tv_nsec += LOOK_EVERY_NS;
	until.tv_sec += until.tv_nsec / SECOND_NS;
	until.tv_nsec %= SECOND_NS;
	while (!disk->ending && ((!disk->copy && !disk->job) || disk->has_news)) {
		if (pthread_cond_timedwait(&disk->wake, &disk->lock, &until) != 0)
			return;
	}
}

static void *run(void *context)
{
	struct disk *disk = context;

	pthread_mutex_lock(&disk->lock);
	/* The copy of the configuration in force is written even when the service ends at once. */
	while (!disk->ending || disk->copy) {
		if (disk->copy && (!disk->has_news || disk->ending)) {
			/* The lock is held before and after. */
			struct disk_news news = { .kept = true };
			char *copy = disk->copy;

			disk->copy = NULL;
			pthread_mutex_unlock(&disk->lock);
			news.error = disk_replace_file(disk->copy_path, disk->written_to, copy);
			free(copy);
			pthread_mutex_lock(&disk->lock);
			/* At the end there may be news that were not fetched. */
			if (!disk->ending)
				give_news(disk, &news);
		} else if (disk->job && !disk->has_news) {
			struct disk_news news = { .job = disk->job };

			disk->job = NULL;
			pthread_mutex_unlock(&disk->lock);
			news.job->work(news.job);
			pthread_mutex_lock(&disk->lock);
			give_news(disk, &news);
		} else if (!disk->has_news && !look_for_upgrade(disk))
			look_at_files(disk);
		wait_for_work(disk);
	}
	pthread_mutex_unlock(&disk->lock);
	return NULL;
}

/* --- its owner -------------------------------------------------------------------------------- */

static void free_parts(struct disk *disk)
{
	if (disk->fd >= 0)
		close(disk->fd);
	free(disk->path);
	free(disk->copy_path);
	free(disk->written_to);
	free(disk->profiles);
	free(disk);
}

int disk_new(const char *path, const char *copy, uint64_t signature, struct disk **disk)
{
	struct disk *made = calloc(1, sizeof(*made));
	pthread_condattr_t clock;
	int error;

	if (!made)
		return -ENOMEM;
	made->expected = signature;
	made->seen = signature;
	made->fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
	error = made->fd < 0 ? -errno : 0;
	made->path = strdup(path);
	if (copy) {
		made->copy_path = strdup(copy);
		if (asprintf(&made->written_to, "%s.new", copy) < 0)
			made->written_to = NULL;
	}
	if (error == 0 && (!made->path || (copy && (!made->copy_path || !made->written_to))))
		error = -ENOMEM;
	if (error == 0) {
		pthread_condattr_init(&clock);
		pthread_condattr_setclock(&clock, CLOCK_MONOTONIC);
		pthread_cond_init(&made->wake, &clock);
		pthread_condattr_destroy(&clock);
		pthread_mutex_init(&made->lock, NULL);
		error = -pthread_create(&made->thread, NULL, run, made);
		if (error != 0) {
			pthread_mutex_destroy(&made->lock);
			pthread_cond_destroy(&made->wake);
		}
	}
	if (error == 0) {
		pthread_setname_np(made->thread, "disk");
		*disk = made;
	} else
		free_parts(made);
	return error;
}

void disk_free(struct disk *disk)
{
	if (!disk)
		return;
	pthread_mutex_lock(&disk->lock);
	disk->ending = true;
	pthread_cond_signal(&disk->wake);
	pthread_mutex_unlock(&disk->lock);
	pthread_join(disk->thread, NULL);
	pthread_mutex_destroy(&disk->lock);
	pthread_cond_destroy(&disk->wake);
	if (disk->has_news) {
		db_config_free(disk->news.config);
		free(disk->news.messages);
		free(disk->news.newer);
	}
	free_parts(disk);
}

int disk_fd(const struct disk *disk)
{
	return disk->fd;
}

bool disk_take_news(struct disk *disk, struct disk_news *news)
{
	eventfd_t count;
	bool there;

	(void)eventfd_read(disk->fd, &count);
	pthread_mutex_lock(&disk->lock);
	there = disk->has_news;
	*news = disk->news;
	disk->has_news = false;
	pthread_cond_signal(&disk->wake);
	pthread_mutex_unlock(&disk->lock);
	return there;
}

void disk_expect(struct disk *disk, uint64_t signature)
{
	pthread_mutex_lock(&disk->lock);
	disk->expected = signature;
	disk->turn++;
	if (disk->has_news && disk->news.read) {
		db_config_free(disk->news.config);
		free(disk->news.messages);
		disk->has_news = false;
	}
	pthread_mutex_unlock(&disk->lock);
}

bool disk_do(struct disk *disk, struct disk_job *job)
{
	bool free_place;

	pthread_mutex_lock(&disk->lock);
	free_place = !disk->job;
	if (free_place)
		disk->job = job;
	pthread_cond_signal(&disk->wake);
	pthread_mutex_unlock(&disk->lock);
	return free_place;
}

void disk_keep(struct disk *disk, char *copy)
{
	if (!disk->copy_path) {
		free(copy);
		return;
	}
	pthread_mutex_lock(&disk->lock);
	free(disk->copy);
	disk->copy = copy;
	pthread_cond_signal(&disk->wake);
	pthread_mutex_unlock(&disk->lock);
}
