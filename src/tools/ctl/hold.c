/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/hold.h"

void db_ctl_hold_press(struct db_ctl_hold *hold, int direction, db_time now)
{
	/* After a long pause the key counts as pressed anew. */
	(void)db_ctl_hold_direction(hold, now);
	/* A change of direction stops first. */
	if (hold->direction != 0 && hold->direction != direction)
		hold->ended = true;
	hold->direction = direction;
	hold->until = now + DB_CTL_HOLD;
}

void db_ctl_hold_cancel(struct db_ctl_hold *hold)
{
	hold->ended = hold->direction != 0;
}

int db_ctl_hold_direction(struct db_ctl_hold *hold, db_time now)
{
	if (hold->direction != 0 && now >= hold->until)
		*hold = (struct db_ctl_hold){ .direction = 0 };
	return hold->ended ? 0 : hold->direction;
}
