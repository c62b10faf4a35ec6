/* SPDX-License-Identifier: Apache-2.0 */
#include "service/status.h"

#include "service/configuration.h"
#include "service/service_private.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <systemd/sd-daemon.h>

#define PERIOD_US 1000000
/* A line of a terminal; names of buses have 31 characters at most. */
#define LINE_MAX_BYTES 240

struct status {
	sd_event_source *timer;
	char line[LINE_MAX_BYTES];
};

static bool is_worse(const struct status_bus *a, const struct status_bus *b)
{
	if (a->down != b->down)
		return a->down;
	if (a->missing != b->missing)
		return a->missing > b->missing;
	return a->utilisation > b->utilisation;
}

void status_add_bus(struct status_figures *figures, const char *name, size_t drives,
                    const struct db_bus_stats *stats)
{
	struct status_bus bus = {
		.name = name,
		.down = !stats->up || !stats->port.up,
		.missing = drives > stats->online ? drives - stats->online : 0,
		.utilisation = stats->utilisation,
		.last_error = stats->last_error,
	};

	figures->drives += drives;
	figures->online += stats->online;
	if (!figures->worst.name || is_worse(&bus, &figures->worst))
		figures->worst = bus;
}

static const char *const about_configuration[DB_CONFIGURATION_STATES] = {
	[DB_CONFIGURATION_IN_FORCE] = "",
	[DB_CONFIGURATION_REFUSED] = "; the configuration on disk was refused, see the log",
	[DB_CONFIGURATION_LAST_GOOD] = ("; RUNS WITH THE LAST GOOD CONFIGURATION, the one on disk "
	                                "has an error, see the log"),
	[DB_CONFIGURATION_CHANGED] =
		"; the configuration on disk has changed and is not loaded yet",
};

void status_write(const struct status_figures *figures, FILE *out)
{
	const struct status_bus *worst = &figures->worst;

	fprintf(out, "%zu of %zu drives online, %" PRIu32 " client%s", figures->online,
	        figures->drives, figures->clients, figures->clients == 1 ? "" : "s");
	if (worst->name)
		fprintf(out, "; worst bus %s: ", worst->name);
	if (worst->down && worst->last_error != 0)
		fprintf(out, "down (%s)", strerror((int)worst->last_error));
	else if (worst->down)
		fprintf(out, "down");
	else if (worst->missing > 0)
		fprintf(out, "%zu drive%s silent", worst->missing, worst->missing == 1 ? "" : "s");
	else if (worst->name)
		fprintf(out, "%" PRIu32 " %% busy", worst->utilisation / 10);
	fputs(about_configuration[figures->configuration], out);
	if (figures->replaced)
		fputs("; an upgrade needs a restart", out);
}

/* Tells systemd the line when it is another one than before. */
static int on_timer(sd_event_source *source, uint64_t us, void *context)
{
	struct service *service = context;
	const struct plant *plant = service->plant;
	struct db_configuration_report report = configuration_report(service);
	struct status_figures figures = {
		.configuration = report.state,
		.replaced = report.replaced[0] != '\0',
	};
	struct db_server_stats clients;
	char line[LINE_MAX_BYTES] = "";
	FILE *out;

	(void)us;
	for (size_t b = 0; b < plant->bus_count; b++) {
		const struct plant_bus *bus = plant->buses[b];
		struct db_bus_stats stats;
		size_t drives = 0;

		db_bus_read_stats(bus->bus, &stats);
		for (size_t i = 0; i < plant->drive_count; i++)
			drives += plant->drives[i]->bus == bus;
		status_add_bus(&figures, bus->config->name, drives, &stats);
	}
	db_server_stats(service->server, &clients);
	figures.clients = clients.clients;
	out = fmemopen(line, sizeof(line), "w");
	if (out) {
		status_write(&figures, out);
		fclose(out);
		line[sizeof(line) - 1] = '\0';
	}
	if (out && strcmp(line, service->status->line) != 0) {
		memcpy(service->status->line, line, sizeof(line));
		sd_notifyf(0, "STATUS=%s", line);
	}
	sd_event_source_set_time_relative(source, PERIOD_US);
	return sd_event_source_set_enabled(source, SD_EVENT_ONESHOT);
}

int status_begin(struct service *service)
{
	int error;

	if (!getenv("NOTIFY_SOCKET"))
		return 0;
	service->status = calloc(1, sizeof(*service->status));
	if (!service->status)
		return -ENOMEM;
	error = sd_event_add_time_relative(service->loop, &service->status->timer, CLOCK_MONOTONIC,
	                                   PERIOD_US, PERIOD_US / 4, on_timer, service);
	return error < 0 ? error : 0;
}

void status_end(struct service *service)
{
	if (!service->status)
		return;
	sd_event_source_disable_unref(service->status->timer);
	free(service->status);
	service->status = NULL;
}
