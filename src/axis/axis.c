/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/axis.h"

#include "drivebridge/seqlock.h"

#include <stdlib.h>

/*
 * Two publications, because the nameplate is large and changes seldom: cyclic readers do not pay
 * for it.
 */
struct db_axis {
	atomic_uint snapshot_sequence;
	atomic_uint nameplate_sequence;
	db_seqlock_word snapshot[DB_SEQLOCK_WORDS(struct db_snapshot)];
	db_seqlock_word nameplate[DB_SEQLOCK_WORDS(struct db_nameplate)];
};

struct db_axis *db_axis_new(void)
{
	return calloc(1, sizeof(struct db_axis));
}

void db_axis_free(struct db_axis *axis)
{
	free(axis);
}

void db_axis_publish(struct db_axis *axis, const struct db_snapshot *snapshot)
{
	db_seqlock_write(&axis->snapshot_sequence, axis->snapshot, snapshot, sizeof *snapshot);
}

void db_axis_publish_nameplate(struct db_axis *axis, const struct db_nameplate *nameplate)
{
	db_seqlock_write(&axis->nameplate_sequence, axis->nameplate, nameplate, sizeof *nameplate);
}

void db_axis_read(const struct db_axis *axis, struct db_snapshot *snapshot)
{
	db_seqlock_read(&axis->snapshot_sequence, axis->snapshot, snapshot, sizeof *snapshot);
}

void db_axis_read_nameplate(const struct db_axis *axis, struct db_nameplate *nameplate)
{
	db_seqlock_read(&axis->nameplate_sequence, axis->nameplate, nameplate, sizeof *nameplate);
}
