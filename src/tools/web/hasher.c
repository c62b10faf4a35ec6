/* SPDX-License-Identifier: Apache-2.0 */
#include "web/hasher.h"
#include "users/pam.h"
#include "web/config.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

/* At the end, for a job that is running: PAM may wait for a directory that does not answer. */
#define END_WITHIN_S 3

enum state { FREE, WAITS, RUNS, DONE };

struct job {
	enum state state;
	struct db_web_work work;
};

struct db_web_hasher {
	pthread_t thread;
	pthread_mutex_t mutex;
	pthread_cond_t changed;
	int fd;
	/* Under the mutex. The running job belongs to the thread. */
	bool ends;
	unsigned next; /* the next job to run */
	struct job jobs[DB_WEB_HASHER_JOBS];
};

static struct job *find_job(struct db_web_hasher *hasher, enum state state)
{
	for (unsigned i = 0; i < DB_WEB_HASHER_JOBS; i++) {
		struct job *job = &hasher->jobs[(hasher->next + i) % DB_WEB_HASHER_JOBS];

		if (job->state == state)
			return job;
	}
	return NULL;
}

static bool change_users(struct db_web_work *work)
{
	const struct db_users_terms terms = {
		.keeper = &db_web_keeper,
		.before = work->known ? &work->user : NULL,
		.by = work->by[0] ? work->by : NULL,
		.pam = db_pam_is_there(work->pam_folder),
	};
	char *said = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&said, &size);
	bool good = out != NULL;

	if (good && work->fresh_password[0] != '\0' &&
	    !db_password_hash(work->fresh_password, work->fresh.hash)) {
		fputs("no hash could be made", out);
		good = false;
	}
	if (good)
		good = work->change == DB_WEB_CHANGE_PUT ?
		               db_users_put(work->path, &work->fresh, &terms, out) :
		               db_users_remove(work->path, work->fresh.name, &terms, out);
	if (out)
		(void)fclose(out);
	/* The last line of what was said, without its end. */
	if (said && !good) {
		const char *last;

		size = strlen(said);
		while (size > 0 && said[size - 1] == '\n')
			said[--size] = '\0';
		last = strrchr(said, '\n');
		snprintf(work->why, sizeof(work->why), "%s", last ? last + 1 : said);
	}
	free(said);
	return good;
}

static void do_work(struct db_web_work *work)
{
	work->right = true;
	work->done = false;
	if (work->compares && work->user.pam)
		work->right = db_pam_check(work->pam_folder, work->user.name, work->password,
		                           work->why, sizeof(work->why));
	else if (work->compares)
		work->right = db_password_matches(work->user.hash, work->password);
	if (work->right && work->change != DB_WEB_CHANGE_NONE)
		work->done = change_users(work);
	explicit_bzero(work->password, sizeof(work->password));
	explicit_bzero(work->fresh_password, sizeof(work->fresh_password));
}

static void *run(void *context)
{
	struct db_web_hasher *hasher = context;
	const uint64_t one = 1;

	(void)pthread_mutex_lock(&hasher->mutex);
	while (!hasher->ends) {
		struct job *job = find_job(hasher, WAITS);

		if (!job) {
			(void)pthread_cond_wait(&hasher->changed, &hasher->mutex);
			continue;
		}
		hasher->next = (unsigned)(job - hasher->jobs) + 1;
		job->state = RUNS;
		(void)pthread_mutex_unlock(&hasher->mutex);
		do_work(&job->work);
		(void)pthread_mutex_lock(&hasher->mutex);
		job->state = DONE;
		(void)!write(hasher->fd, &one, sizeof(one));
	}
	(void)pthread_mutex_unlock(&hasher->mutex);
	return NULL;
}

struct db_web_hasher *db_web_hasher_new(void)
{
	struct db_web_hasher *hasher = calloc(1, sizeof(*hasher));

	if (!hasher)
		return NULL;
	hasher->fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
	(void)pthread_mutex_init(&hasher->mutex, NULL);
	(void)pthread_cond_init(&hasher->changed, NULL);
	if (hasher->fd >= 0 && pthread_create(&hasher->thread, NULL, run, hasher) == 0)
		return hasher;
	if (hasher->fd >= 0)
		(void)close(hasher->fd);
	(void)pthread_mutex_destroy(&hasher->mutex);
	(void)pthread_cond_destroy(&hasher->changed);
	free(hasher);
	return NULL;
}

void db_web_hasher_free(struct db_web_hasher *hasher)
{
	struct timespec until;

	if (!hasher)
		return;
	(void)pthread_mutex_lock(&hasher->mutex);
	hasher->ends = true;
	(void)pthread_cond_signal(&hasher->changed);
	(void)pthread_mutex_unlock(&hasher->mutex);
	(void)clock_gettime(CLOCK_REALTIME, &until);
	until.tv_sec += END_WITHIN_S;
	if (pthread_timedjoin_np(hasher->thread, NULL, &until) != 0) {
		/* The memory stays the thread's until the program has ended. */
		(void)pthread_detach(hasher->thread);
		return;
	}
	(void)pthread_mutex_destroy(&hasher->mutex);
	(void)pthread_cond_destroy(&hasher->changed);
	(void)close(hasher->fd);
	explicit_bzero(hasher, sizeof(*hasher));
	free(hasher);
}

bool db_web_hasher_ask(struct db_web_hasher *hasher, const struct db_web_work *work, bool known)
{
	struct job *job = NULL;
	unsigned free_jobs = 0;

	(void)pthread_mutex_lock(&hasher->mutex);
	for (size_t i = 0; i < DB_WEB_HASHER_JOBS; i++)
		free_jobs += hasher->jobs[i].state == FREE;
	if (known || free_jobs > DB_WEB_HASHER_KNOWN)
		job = find_job(hasher, FREE);
	if (job) {
		job->state = WAITS;
		job->work = *work;
		(void)pthread_cond_signal(&hasher->changed);
	}
	(void)pthread_mutex_unlock(&hasher->mutex);
	return job;
}

int db_web_hasher_fd(const struct db_web_hasher *hasher)
{
	return hasher->fd;
}

bool db_web_hasher_take(struct db_web_hasher *hasher, struct db_web_work *work)
{
	struct job *job;
	uint64_t count;

	(void)!read(hasher->fd, &count, sizeof(count));
	(void)pthread_mutex_lock(&hasher->mutex);
	job = find_job(hasher, DONE);
	if (job) {
		*work = job->work;
		explicit_bzero(&job->work, sizeof(job->work));
		job->state = FREE;
	}
	(void)pthread_mutex_unlock(&hasher->mutex);
	return job;
}
