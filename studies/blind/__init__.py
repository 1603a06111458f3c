"""Score closed loops on blind campaigns, by the test stand's judgements; shares no code with the package.

- score: the command line, what is read, and the page that is written
- tables, figures: of a blind suite; families: of campaigns as real ones are
- advice: whether the records that were advised told two effects apart
"""
