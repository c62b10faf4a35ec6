/* SPDX-License-Identifier: Apache-2.0 */
/* A service as it is once it runs, put together from its real parts around the fakes. */
#ifndef DRIVEBRIDGE_TESTS_SERVICE_BENCH_H
#define DRIVEBRIDGE_TESTS_SERVICE_BENCH_H

#include "fakes.h"

#include "service/service_private.h"

#include <signal.h>

struct bench {
	char path[64]; /* of the configuration */
	struct service service;
};

static void write_file(const struct bench *bench, const char *text)
{
	FILE *file = fopen(bench->path, "w");

	assert_non_null(file);
	assert_true(fputs(text, file) >= 0);
	assert_int_equal(fclose(file), 0);
}

/* As it is once it runs, but without a turn of its loop. */
static void begin_service(struct bench *bench, const char *text)
{
	const char *where;
	struct service *service = &bench->service;
	struct db_config *config = NULL;
	struct plant_roster roster;
	sigset_t signals;
	int fd;

	memset(&fake, 0, sizeof(fake));
	expected_to_here = NULL;
	*bench = (struct bench){ .path = "/tmp/drivebridge-service-XXXXXX" };
	fd = mkstemp(bench->path);
	assert_true(fd >= 0);
	close(fd);
	write_file(bench, text);
	assert_int_equal(db_config_load(bench->path, stderr, &config), 0);
	*service = (struct service){ .path = bench->path, .lock = -1 };
	/* The loop wants them blocked, as the service has them. */
	sigemptyset(&signals);
	sigaddset(&signals, SIGTERM);
	sigaddset(&signals, SIGINT);
	sigaddset(&signals, SIGHUP);
	assert_int_equal(sigprocmask(SIG_BLOCK, &signals, NULL), 0);
	assert_int_equal(plant_new(service, config, NULL, &service->last_number, &service->plant),
	                 0);
	assert_true(loop_new(service) >= 0);
	assert_true(traces_begin(service) >= 0);
	assert_int_equal(plant_roster_init(&roster, service->plant), 0);
	assert_int_equal(db_registers_new(&roster.roster, &service_registers_ops, service,
	                                  &service->registers),
	                 0);
	plant_roster_release(&roster);
	assert_int_equal(db_server_new(service->loop, &config->modbus, &db_registers_backend,
	                               service->registers, &service->log, &service->server, &where),
	                 0);
	clear_journal();
}

static void end_service(struct bench *bench)
{
	struct service *service = &bench->service;

	db_server_free(service->server);
	plant_end(service->plant);
	reload_abandon(service);
	db_registers_free(service->registers);
	plant_free(service->plant, NULL);
	traces_end(service);
	loop_free(service);
	unlink(bench->path);
}

#endif
