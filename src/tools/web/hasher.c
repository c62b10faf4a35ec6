/* SPDX-License-Identifier: Apache-2.0 */
#include "web/hasher.h"
#include "users/users.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

enum state { FREE, WAITS, RUNS, DONE };

struct job {
	enum state state;
	bool right;
	uint64_t number;
	char password[DB_USERS_PASSWORD_MAX + 1];
	char hash[sizeof(((struct db_user *)0)->hash)];
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

static void *run(void *context)
{
	struct db_web_hasher *hasher = context;
	const uint64_t one = 1;

	(void)pthread_mutex_lock(&hasher->mutex);
	while (!hasher->ends) {
		struct job *job = find_job(hasher, WAITS);
		bool right;

		if (!job) {
			(void)pthread_cond_wait(&hasher->changed, &hasher->mutex);
			continue;
		}
		hasher->next = (unsigned)(job - hasher->jobs) + 1;
		job->state = RUNS;
		(void)pthread_mutex_unlock(&hasher->mutex);
		right = db_users_has_password(job->hash, job->password);
		(void)pthread_mutex_lock(&hasher->mutex);
		explicit_bzero(job->password, sizeof(job->password));
		job->right = right;
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
	if (!hasher)
		return;
	(void)pthread_mutex_lock(&hasher->mutex);
	hasher->ends = true;
	(void)pthread_cond_signal(&hasher->changed);
	(void)pthread_mutex_unlock(&hasher->mutex);
	(void)pthread_join(hasher->thread, NULL);
	(void)pthread_mutex_destroy(&hasher->mutex);
	(void)pthread_cond_destroy(&hasher->changed);
	(void)close(hasher->fd);
	explicit_bzero(hasher, sizeof(*hasher));
	free(hasher);
}

bool db_web_hasher_ask(struct db_web_hasher *hasher, uint64_t number, const char *password,
                       const char *hash, bool known)
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
		job->number = number;
		(void)snprintf(job->password, sizeof(job->password), "%s", password);
		(void)snprintf(job->hash, sizeof(job->hash), "%s", hash);
		(void)pthread_cond_signal(&hasher->changed);
	}
	(void)pthread_mutex_unlock(&hasher->mutex);
	return job;
}

int db_web_hasher_fd(const struct db_web_hasher *hasher)
{
	return hasher->fd;
}

bool db_web_hasher_take(struct db_web_hasher *hasher, uint64_t *number, bool *right)
{
	struct job *job;
	uint64_t count;

	(void)!read(hasher->fd, &count, sizeof(count));
	(void)pthread_mutex_lock(&hasher->mutex);
	job = find_job(hasher, DONE);
	if (job) {
		*number = job->number;
		*right = job->right;
		job->state = FREE;
	}
	(void)pthread_mutex_unlock(&hasher->mutex);
	return job;
}
