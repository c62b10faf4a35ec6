/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/account.h"

#include "axis/state.h"

#include <string.h>

static void add_entry(struct db_commander *commander, const struct db_client *client,
                      struct db_history_entry *entry, struct db_slot *slot)
{
	uint32_t number;

	entry->timestamp_us = commander->ops->wall_us(commander->context);
	if (client) {
		memcpy(entry->address, client->address, sizeof entry->address);
		entry->port = client->port;
	}
	number = db_history_add(&commander->history, entry, slot != NULL);
	if (slot)
		slot->entry = number;
}

void db_account_add_command(struct db_commander *commander, const struct db_client *client,
                            const struct db_command_block *block, uint16_t id,
                            enum db_result result, struct db_slot *slot)
{
	struct db_history_entry entry = {
		.command_id = id,
		.command = block->command,
		.result = (uint16_t)result,
	};

	db_history_args(&entry, block->command, &block->args);
	add_entry(commander, client, &entry, slot);
}

void db_account_add_settings(struct db_commander *commander, const struct db_client *client,
                             const struct db_setting *settings, enum db_result result,
                             struct db_slot *slot)
{
	const struct db_driver *driver = commander->config.driver;
	uint16_t param = settings[0].param;
	/* Everybody who may read reads the history. */
	bool secret = param < driver->param_count &&
	              (driver->params[param].traits & DB_PARAM_SECRET);
	struct db_history_entry entry = {
		.number = param,
		.value = secret ? 0 : settings[0].value.u,
		.result = (uint16_t)result,
	};

	add_entry(commander, client, &entry, slot);
}

void db_account_log_refusal(const struct db_commander *commander, const struct db_client *client,
                            const struct db_refused_write *write)
{
	switch (write->result) {
	case DB_RESULT_NONE:
	case DB_RESULT_OK:
	case DB_RESULT_UNPROVEN:
	case DB_RESULT_PENDING:
	/* What others tell of. */
	case DB_RESULT_CANCELLED:
	case DB_RESULT_NOT_IN_CONTROL:
	case DB_RESULT_RUNS_ON:
		return;
	default:
		if (commander->ops->refused)
			commander->ops->refused(commander->context, client, write);
	}
}
